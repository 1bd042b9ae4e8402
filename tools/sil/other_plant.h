// Whether a run begins on a bus where another is under way: for runs with their peers in their own process, or in QEMU,
// which say on a bus what happens but go on without it. (LcmPeers, which need the bus, find out by themselves.)
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "hal/lcm/bus.h"

namespace ballast::sil {

// Listens for another plant before the run, and for the first second of it: of two that begin at once
// one hears the other then, or each does. Later ones are refused by their own.
class OtherPlant {
 public:
  // `run_id`: one's own.
  OtherPlant(const std::string& url, std::int64_t run_id);

  // Long enough to hear a plant that is at work at any usual pace. Empty, or who is there.
  std::string listen();
  // In every tick; it costs nothing after that second. Likewise.
  std::string heard();

 private:
  void take(std::chrono::duration<double> wait);

  std::unique_ptr<hal::Bus> bus_;
  std::int64_t run_id_;
  std::optional<hal::WallClock::time_point> until_;
  std::string found_;
};

}  // namespace ballast::sil
