// Who talks on a bus, and whether this build understands them.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "tools/program/finding.h"

namespace ballast::doctor {

// What has been heard on one channel.
struct Channel {
  std::int64_t count = 0;
  std::int64_t foreign = 0;             // of a type with another fingerprint: another build, or not Ballast at all
  std::int64_t malformed = 0;           // the right fingerprint, but not that message, or not in its range
  std::uint64_t fingerprint = 0;        // of the last foreign one
  std::set<std::int64_t> scenario_ids;  // fingerprints of scenarios, where the message has one
  std::set<std::int64_t> run_ids;       // the runs' numbers; messages of no run have none
};

class Listener {
 public:
  void hear(const std::string& channel, const void* data, std::size_t size);
  [[nodiscard]] const std::map<std::string, Channel>& channels() const { return channels_; }

 private:
  std::map<std::string, Channel> channels_;
};

// How long LCM is to wait for the next message when this much is left: at most 1 s, so that it fits LCM's int of ms
// however long the listening; 0: the time is over.
int wait_ms(hal::WallClock::duration left);

// Everything said on the bus for this long. False: it cannot be listened to.
bool listen(const std::string& url, hal::Seconds time, Listener& listener);

// Each channel a line, and what does not fit together as failures.
std::vector<program::Finding> judge(const Listener& listener, const std::string& url, hal::Seconds time);

}  // namespace ballast::doctor
