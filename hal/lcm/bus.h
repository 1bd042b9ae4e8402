// One connection to an LCM bus: only whole, valid messages of one's own run get through, and waiting always ends.
//
// A bus is anybody's: LCM knows no senders and no keys. So every run has a number, drawn by its plant, which all its
// messages carry, and whoever has joined a run hears no other. That keeps out accidents: a log played back, a run
// before this one that still talks, a second run on the same bus. It keeps out nobody who reads the bus and means harm.
#pragma once

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"
#include "hal/status.h"

namespace ballast::hal {

using WallClock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// Callers measure silence in seconds that may be huge; this saturates where WallClock would overflow.
inline WallClock::time_point after(WallClock::time_point start, Seconds wait) {
  constexpr Seconds kAboutForever{1e8};
  return start + std::chrono::duration_cast<WallClock::duration>(wait < kAboutForever ? wait : kAboutForever);
}

// For a run, or for a sender of operator_t: hardly ever one that somebody else has drawn; never 0.
inline std::int64_t draw_bus_number() {
  std::random_device random;
  for (;;) {
    const std::uint64_t number = std::uint64_t{random()} << 32 | random();
    if (number >> 1 != 0) return static_cast<std::int64_t>(number >> 1);
  }
}

class Bus {
 public:
  // `interrupted`: nonzero makes every wait return kInterrupted within 50 ms; must outlive the bus. Check good() first.
  explicit Bus(const std::string& url, const volatile std::sig_atomic_t* interrupted = nullptr)
      : interrupted_(interrupted), lcm_(url) {}
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  [[nodiscard]] bool good() const { return lcm_.good(); }

  // From now on what is published carries this run's number, and what is heard of other runs is counted and dropped;
  // but for the words of peers that wait for a run. Before, everything is heard, and what is published is of no run.
  void join(std::int64_t run_id) { run_id_ = run_id; }
  [[nodiscard]] std::int64_t run_id() const { return run_id_; }  // 0: none joined

  // Calls `on_message` for each valid message of this channel, from inside receive_until(). Others are counted.
  template <class M>
  void subscribe(const char* channel, std::function<void(const M&)> on_message) {
    if (!good()) return;
    auto receiver = std::make_shared<Receiver<M>>(Receiver<M>{std::move(on_message), this});
    // A plain function: GCC 12's undefined-behaviour sanitizer breaks LCM's call through a pointer to member.
    lcm::Subscription* subscription = lcm_.subscribeFunction(channel, &Receiver<M>::handle, receiver.get());
    // LCM's own limit of 30 would silently drop messages while this process is not scheduled.
    subscription->setQueueCapacity(kQueueCapacity);
    receivers_.push_back(std::move(receiver));
  }

  template <class M>
  Status publish(const char* channel, M message) {
    message.run_id = run_id_;
    return lcm_.publish(channel, &message) == 0 ? Status::kOk : Status::kIo;
  }

  // Handles messages one by one until done(); kEmpty: it was not by the deadline. What has already arrived by then is
  // still handled (a process that was suspended must not blame its peers), up to a bound.
  template <class Done>
  Status receive_until(WallClock::time_point deadline, const Done& done) {
    int late = 0;
    while (!done()) {
      if (interrupted_ != nullptr && *interrupted_ != 0) return Status::kInterrupted;
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - WallClock::now()).count();
      if (left <= 0 && ++late > kQueueCapacity) return Status::kEmpty;
      errno = 0;
      const int handled = lcm_.handleTimeout(left <= 0 ? 0 : left < kPollMs ? static_cast<int>(left) : kPollMs);
      if (handled < 0 && errno != EINTR) return Status::kIo;
      if (handled == 0 && left <= 0) return Status::kEmpty;
    }
    return Status::kOk;
  }

  [[nodiscard]] std::int64_t malformed() const { return malformed_; }
  [[nodiscard]] std::int64_t foreign() const { return foreign_; }  // valid, of another run

 private:
  static constexpr int kQueueCapacity = 1000;
  static constexpr int kPollMs = 50;

  template <class M>
  struct Receiver {
    std::function<void(const M&)> on_message;
    Bus* bus;

    static void handle(const lcm::ReceiveBuffer* buffer, const std::string&, Receiver* self) {
      M message{};
      if (!decode(buffer->data, buffer->data_size, message)) {
        ++self->bus->malformed_;
      } else if (!self->bus->is_ours(message)) {
        ++self->bus->foreign_;
      } else {
        self->on_message(message);
      }
    }
  };

  template <class M>
  [[nodiscard]] bool is_ours(const M& message) const {
    constexpr bool kMayWait = std::is_same_v<M, controller_status_t> || std::is_same_v<M, trip_t>;
    return run_id_ == 0 || message.run_id == run_id_ ||
           (kMayWait && message.run_id == 0 && message.tick == kWaitingTick);
  }

  const volatile std::sig_atomic_t* interrupted_;
  std::int64_t run_id_ = 0;
  std::int64_t malformed_ = 0, foreign_ = 0;
  std::vector<std::shared_ptr<void>> receivers_;
  lcm::LCM lcm_;  // last: goes first, so that no receiver is called after its end
};

}  // namespace ballast::hal
