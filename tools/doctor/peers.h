// Checks which programs send on a bus and whether this build can decode their messages.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "tools/program/finding.h"

namespace ballast::doctor {

// The messages received on one channel.
struct Channel {
  std::int64_t count = 0;
  std::int64_t foreign = 0;             // messages of a type with another fingerprint: of another build or program
  std::int64_t malformed = 0;           // messages with the right fingerprint that do not decode or are out of range
  std::uint64_t fingerprint = 0;        // of the latest foreign message
  std::set<std::int64_t> scenario_ids;  // fingerprints of scenarios
  std::set<std::int64_t> run_ids;       // numbers of runs
};

class Listener {
 public:
  void hear(const std::string& channel, const void* data, std::size_t size);
  [[nodiscard]] const std::map<std::string, Channel>& channels() const { return channels_; }

 private:
  std::map<std::string, Channel> channels_;
};

// The time in ms that LCM may wait for the next message: at most 1 s, so that it fits LCM's int; 0 if no time is left.
int wait_ms(hal::WallClock::duration left);

// Passes all messages on the bus during this time to `listener`. False: the bus cannot be used.
bool listen(const std::string& url, hal::Seconds time, Listener& listener);

// One finding per channel, and failures for messages that do not fit together.
std::vector<program::Finding> judge(const Listener& listener, const std::string& url, hal::Seconds time);

}  // namespace ballast::doctor
