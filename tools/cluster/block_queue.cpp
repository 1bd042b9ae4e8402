#include "tools/cluster/block_queue.h"

#include <mpi.h>

#include <chrono>
#include <thread>

namespace ballast::cluster {
namespace {

constexpr int kReportTag = 1, kGrantTag = 2;
constexpr std::uint64_t kNone = ~std::uint64_t{0};

enum class Wish : std::uint64_t { kBlock, kEnd };

// A rank's message to rank 0: what it has done since its last report, and whether it wants another block.
struct Report {
  Done done;
  Wish wish = Wish::kBlock;
  char trouble[488] = {};
};
constexpr int kReportBytes = sizeof(Report);

void send(const Report& report) { MPI_Send(&report, kReportBytes, MPI_BYTE, 0, kReportTag, MPI_COMM_WORLD); }

// An answer that is on its way.
class Answer {
 public:
  Answer() { MPI_Irecv(&block_, 1, MPI_UINT64_T, 0, kGrantTag, MPI_COMM_WORLD, &request_); }
  std::uint64_t wait() {
    int arrived = 0;
    for (MPI_Test(&request_, &arrived, MPI_STATUS_IGNORE); arrived == 0;
         MPI_Test(&request_, &arrived, MPI_STATUS_IGNORE))
      rest();
    return block_;
  }

 private:
  std::uint64_t block_ = kNone;
  MPI_Request request_ = MPI_REQUEST_NULL;
};

}  // namespace

void rest() { std::this_thread::sleep_for(std::chrono::microseconds(200)); }

std::optional<std::uint64_t> BlockQueue::take() {
  return next_ < blocks_.size() ? std::optional(blocks_[next_++]) : std::nullopt;
}

void BlockQueue::stop(const std::string& trouble) {
  next_ = blocks_.size();
  if (trouble_.empty()) trouble_ = trouble;
}

void BlockQueue::serve() {
  for (;;) {
    int arrived = 0;
    MPI_Status from;
    MPI_Iprobe(MPI_ANY_SOURCE, kReportTag, MPI_COMM_WORLD, &arrived, &from);
    if (arrived == 0) return;
    Report report;
    MPI_Recv(&report, kReportBytes, MPI_BYTE, from.MPI_SOURCE, kReportTag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    ++messages_;
    done_.rows += report.done.rows;
    done_.held += report.done.held;
    if (report.trouble[0] != '\0') stop(report.trouble);
    if (report.wish == Wish::kEnd) {
      --working_;
      continue;
    }
    const std::uint64_t block = take().value_or(kNone);
    MPI_Send(&block, 1, MPI_UINT64_T, from.MPI_SOURCE, kGrantTag, MPI_COMM_WORLD);
    ++messages_;
  }
}

void compute_blocks(const std::function<std::string(std::uint64_t block, Done& done)>& compute,
                    const std::function<bool()>& interrupted) {
  Done done;
  std::string trouble;
  send({});
  std::uint64_t block = Answer().wait();
  while (block != kNone) {
    Answer next;
    send({done, Wish::kBlock, {}});
    done = {};
    if (trouble.empty() && !interrupted()) trouble = compute(block, done);
    block = next.wait();
    if (!trouble.empty() || interrupted()) break;
  }
  Report last{done, Wish::kEnd, {}};
  last.trouble[trouble.copy(last.trouble, sizeof last.trouble - 1)] = '\0';
  send(last);
}

void report_trouble(const std::string& trouble) {
  Report report{{}, Wish::kEnd, {}};
  report.trouble[trouble.copy(report.trouble, sizeof report.trouble - 1)] = '\0';
  send(report);
}

}  // namespace ballast::cluster
