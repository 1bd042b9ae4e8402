#include "tools/sil/pace.h"

#include <algorithm>
#include <thread>

namespace ballast::sil {

void Pace::keep(std::int64_t tick, double time_s, double end_s) {
  using Seconds = std::chrono::duration<double>;
  if (options_.speed > 0) {
    const Seconds until((hold_s_ + time_s) / options_.speed);
    // A signal that comes just before a sleep does not end it, so no sleep is long.
    for (;;) {
      const Seconds left = until - (Clock::now() - start_);
      const bool interrupted = options_.interrupted != nullptr && *options_.interrupted != 0;
      if (left <= Seconds(0) || interrupted) break;
      std::this_thread::sleep_for(std::min(left, Seconds(0.1)));
    }
  }
  // Reading the clock in every tick would cost more than the tick's messages.
  if (options_.progress && (tick & 63) == 0 && Clock::now() >= next_progress_) {
    options_.progress(std::max(0.0, time_s), end_s);
    next_progress_ = Clock::now() + std::chrono::milliseconds(100);
  }
}

}  // namespace ballast::sil
