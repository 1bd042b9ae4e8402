// The blocks of a sweep, handed out to the ranks of an MPI program. Rank 0 keeps the list, answers the others between
// its own rows, and computes blocks itself. Every other rank asks for its next block before it begins the one it has,
// so that it does not wait for the answer. A block takes two messages, of kReportBytes and of 8 bytes; blocks of rank 0
// none.
//
// MPI is called by one thread of each rank only. Waiting ranks sleep between looks, because there may be more of them
// than processors.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace ballast::cluster {

// Rows that have been finished, and how many of them hold.
struct Done {
  std::uint64_t rows = 0, held = 0;
};

// Rank 0.
class BlockQueue {
 public:
  BlockQueue(std::vector<std::uint64_t> blocks, int ranks) : blocks_(std::move(blocks)), working_(ranks - 1) {}

  // A block for rank 0 itself; nullopt: none is left.
  [[nodiscard]] std::optional<std::uint64_t> take();
  // Answers the messages that have arrived.
  void serve();
  // Hands out no more blocks. The first reason counts; an empty one is an interruption.
  void stop(const std::string& trouble);
  // Whether all other ranks have ended.
  [[nodiscard]] bool ended() const { return working_ == 0; }

  [[nodiscard]] const Done& done() const { return done_; }  // by the others
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  std::vector<std::uint64_t> blocks_;
  std::size_t next_ = 0;
  int working_;
  Done done_;
  std::string trouble_;
  std::uint64_t messages_ = 0;
};

// A rank that is not 0: calls `compute` with one block after the other. It adds what it has done; its text is empty, or
// what could not be done. Ends when no block is left, after a failure, or when `interrupted` is true.
void compute_blocks(const std::function<std::string(std::uint64_t block, Done& done)>& compute,
                    const std::function<bool()>& interrupted);
// A rank that is not 0 and cannot compute.
void report_trouble(const std::string& trouble);

// Sleeps for a moment, while waiting for messages.
void rest();

}  // namespace ballast::cluster
