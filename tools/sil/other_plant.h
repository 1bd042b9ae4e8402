// Detects another run on the same bus, for runs that publish on a bus but do not depend on it: those in one process and
// those in QEMU. (LcmPeers, which need the bus, detect it by themselves.)
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "hal/lcm/bus.h"

namespace ballast::sil {

// Listens for another plant before the run and for its first second: of two runs that begin at once, at least one hears
// the other then. A run that begins later hears this one.
class OtherPlant {
 public:
  // `run_id`: this run's.
  OtherPlant(const std::string& url, std::int64_t run_id);

  // Listens long enough to hear a plant at any usual pace. Returns empty, or a line about the other plant.
  std::string listen();
  // Call in every tick; costs nothing after the first second. Returns as listen().
  std::string heard();

 private:
  void take(std::chrono::duration<double> wait);

  std::unique_ptr<hal::Bus> bus_;
  std::int64_t run_id_;
  std::optional<hal::WallClock::time_point> until_;
  std::string found_;
};

}  // namespace ballast::sil
