// The reader of event logs, and a replay of what it reads. Input: a log.
#include <sys/mman.h>
#include <unistd.h>

#include "tests/fuzz/fuzz_target.h"
#include "tools/sil/log_reader.h"
#include "tools/sil/replay.h"

namespace ballast::fuzz {
namespace {

// A file that is nowhere but in memory, and has a name as long as it is open.
class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : file_(memfd_create("fuzz", MFD_CLOEXEC)) {
    require(file_ >= 0, "a file in memory");
    require(write(file_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()), "room for the input");
  }
  ~MemoryFile() { close(file_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

// Answers nothing that was recorded: every tick differs.
class Silent final : public sil::Peers {
 public:
  hal::Status connect() override { return hal::Status::kOk; }
  hal::Status exchange(sil::Lap& lap) override {
    lap.status.tick = lap.plant.sensors.tick;
    return hal::Status::kOk;
  }
  [[nodiscard]] std::string trouble() const override { return ""; }
};

}  // namespace

bool take(std::span<const std::uint8_t> input) {
  const MemoryFile file(input);
  sil::LogReader reader(file.path());
  std::size_t bytes = 0;
  sil::LogEvent event;
  while (reader.next(event)) bytes += 28 + event.channel.size() + event.data.size();
  require(reader.error().empty() || bytes == 0, "nothing is read of what is no log");
  require(bytes <= input.size(), "no more is read than there is");
  require(reader.error().empty() && reader.damage().empty() ? bytes == input.size() : true,
          "all is read, or it is said why not");

  const sil::LogScenario of_log = sil::scenario_of_log(file.path());
  require(of_log.id.has_value() == of_log.trouble.empty(), "a log has a scenario, or it is said why not");
  sim::Scenario scenario;
  scenario.id = of_log.id.value_or(0);
  Silent peers;
  const sil::ReplayResult result = sil::replay(scenario, file.path(), peers, "/dev/null", {});
  require((result.end == sil::ReplayResult::End::kReplayed) == result.trouble.empty(), "a failure has a reason");
  require(result.end != sil::ReplayResult::End::kReplayed || result.ticks > 0, "a replay has ticks");
  require(result.ticks_that_differ <= result.ticks, "no more ticks differ than there are");
  return result.ticks > 0;
}

}  // namespace ballast::fuzz
