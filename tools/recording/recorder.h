// The record of a run: every message, in LCM's event-log format, stamped with simulated time; and the bus, if there is
// one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"

namespace ballast::sil {

class Recorder {
 public:
  // Writes to `log_path`, and publishes on `bus` unless it is null, there with the run's number. `unbuffered`: every
  // message is on disk at once. `tail_ticks`: how much tail_offset() is to leave.
  explicit Recorder(const std::string& log_path, lcm::LCM* bus = nullptr, bool unbuffered = false,
                    std::int64_t run_id = 0, std::int64_t tail_ticks = kTailTicks);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  template <class M>
  void record(const char* channel, const M& message) {
    encode(message);
    write(channel, message.utime);
    if (bus_ == nullptr) return;
    M published = message;
    published.run_id = run_id_;
    encode(published);
    publish(channel);
  }
  // What somebody else has put on the bus; stamped with the time of the lap it was heard in.
  template <class M>
  void record_heard(const char* channel, const M& message, std::int64_t utime) {
    encode(message);
    write(channel, utime);
  }

  // The fault disk_full: from this simulated time on the disk has no room. Nothing more is written, and what is asked
  // for is an error, which says that it was asked for.
  void disk_full_from(double time_s) {
    full_utime_ = std::min(full_utime_, static_cast<std::int64_t>(std::llround(time_s * 1e6)));
  }

  // Between two laps, so that the log's end can be cut off at the beginning of one.
  void begin_lap() {
    if (laps_++ % kTailStride != 0) return;
    tail_.push_back(bytes_);
    if (static_cast<std::int64_t>(tail_.size()) > (tail_ticks_ - 1) / kTailStride + 2) tail_.pop_front();
  }
  // The byte of the log at which its last tail_ticks laps begin, or up to 2 kTailStride more; all, if there are fewer.
  [[nodiscard]] std::int64_t tail_offset() const { return tail_.empty() ? 0 : tail_.front(); }
  static constexpr std::int64_t kTailTicks = 4096, kTailStride = 64;
  static constexpr double kTailSeconds = 4;
  // kTailTicks, or where that is less than kTailSeconds, those.
  static std::int64_t tail_ticks(double control_period_s) {
    return std::max(kTailTicks, static_cast<std::int64_t>(std::ceil(kTailSeconds / control_period_s)));
  }

  // Of the log, so far.
  [[nodiscard]] std::int64_t bytes() const { return bytes_; }

  // Flushes. False once anything could not be written; error() says what.
  bool close();
  [[nodiscard]] bool good() const { return error_.empty(); }
  [[nodiscard]] const std::string& error() const { return error_; }

 private:
  template <class M>
  void encode(const M& message) {
    const int size = message.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));
    message.encode(buffer_.data(), 0, size);
  }
  void write(const char* channel, std::int64_t utime);
  void publish(const char* channel);

  std::string log_path_;
  lcm_eventlog_t* log_ = nullptr;
  lcm::LCM* bus_;
  bool flush_;
  std::int64_t run_id_, tail_ticks_;
  std::vector<char> buffer_;
  std::int64_t full_utime_ = std::numeric_limits<std::int64_t>::max();
  std::int64_t bytes_ = 0, laps_ = 0;
  std::deque<std::int64_t> tail_;
  std::string error_;
};

}  // namespace ballast::sil
