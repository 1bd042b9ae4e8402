// A connection to an LCM bus. Only whole, valid messages of the joined run get through, and every wait ends.
//
// LCM knows no senders and no keys. So every run has a number, drawn by its plant, that all its messages carry; a bus
// that has joined a run drops messages of others. This protects against accidents: a log played back, an earlier run
// that still sends, a second run on the same bus. It does not protect against a sender that copies the number.
//
// One thread uses a bus; callbacks run inside receive_until().
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

// `start` + `wait`, limited to about 3 years: callers' timeouts may be too large for WallClock.
inline WallClock::time_point after(WallClock::time_point start, Seconds wait) {
  constexpr Seconds kAboutForever{1e8};
  return start + std::chrono::duration_cast<WallClock::duration>(wait < kAboutForever ? wait : kAboutForever);
}

// A random number for a run or for a sender of operator_t, never 0. With 63 bits, two draws hardly ever agree.
inline std::int64_t draw_bus_number() {
  std::random_device random;
  for (;;) {
    const std::uint64_t number = std::uint64_t{random()} << 32 | random();
    if (number >> 1 != 0) return static_cast<std::int64_t>(number >> 1);
  }
}

// Whether the bus can be used. LCM calls a TCP server that does not answer good, and aborts later.
inline bool usable(lcm::LCM& lcm, const std::string& url) {
  return lcm.good() && (!url.starts_with("tcpq") || lcm.getFileno() >= 0);
}

// The URL by which others meet on this bus: without the size of a receive buffer, which is that of one end alone.
inline std::string shared_url(std::string url) {
  const std::size_t at = url.find("recv_buf_size=");
  if (at == std::string::npos || at == 0) return url;
  const std::size_t next = url.find('&', at);
  return next == std::string::npos ? url.erase(at - 1) : url.erase(at, next + 1 - at);
}

class Bus {
 public:
  // Check good() first. Once `*interrupted` is nonzero, every wait returns kInterrupted within 50 ms. `interrupted`
  // must outlive the bus.
  explicit Bus(const std::string& url, const volatile std::sig_atomic_t* interrupted = nullptr)
      : url_(shared_url(url)), interrupted_(interrupted), lcm_(url), good_(usable(lcm_, url)) {}
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] const std::string& url() const { return url_; }  // shared_url()

  // Joins a run. From now on published messages carry its number, and messages of other runs are counted and dropped,
  // except those of peers that wait for a run. Before, all messages are heard, and published ones carry 0.
  void join(std::int64_t run_id) { run_id_ = run_id; }
  [[nodiscard]] std::int64_t run_id() const { return run_id_; }  // 0: no run joined

  // Calls `on_message` for each valid message of the channel, from inside receive_until(). Invalid ones are counted.
  template <class M>
  void subscribe(const char* channel, std::function<void(const M&)> on_message) {
    if (!good()) return;
    auto receiver = std::make_shared<Receiver<M>>(Receiver<M>{std::move(on_message), this});
    // A plain function: GCC 12's undefined-behaviour sanitizer breaks LCM's call through a pointer to member.
    lcm::Subscription* subscription = lcm_.subscribeFunction(channel, &Receiver<M>::handle, receiver.get());
    // LCM's default of 30 silently drops messages while this process is not scheduled.
    subscription->setQueueCapacity(kQueueCapacity);
    receivers_.push_back(std::move(receiver));
  }

  template <class M>
  Status publish(const char* channel, M message) {
    message.run_id = run_id_;
    return lcm_.publish(channel, &message) == 0 ? Status::kOk : Status::kIo;
  }

  // Handles messages one by one until done(). kEmpty: the deadline passed first. Messages that have arrived by then are
  // still handled, up to kQueueCapacity, so that a process that was suspended does not blame its peers.
  template <class Done>
  Status receive_until(WallClock::time_point deadline, const Done& done) {
    int late = 0;
    while (!done()) {
      if (interrupted_ != nullptr && *interrupted_ != 0) return Status::kInterrupted;
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - WallClock::now()).count();
      if (left <= 0) ++late;
      if (late > kQueueCapacity) return Status::kEmpty;
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

  std::string url_;
  const volatile std::sig_atomic_t* interrupted_;
  std::int64_t run_id_ = 0;
  std::int64_t malformed_ = 0, foreign_ = 0;
  std::vector<std::shared_ptr<void>> receivers_;
  lcm::LCM lcm_;  // destroyed before the receivers: none is called after its end
  bool good_;
};

}  // namespace ballast::hal
