// The record of a run: every message in LCM's event-log format, stamped with simulated time, and on the bus if there is
// one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/encode.h"
#include "hal/lcm/messages.h"
#include "tools/recording/log_writer.h"
#include "tools/sil/lap_sink.h"

namespace ballast::sil {

class Recorder final : public LapSink {
 public:
  // Writes to `log_path`; empty: nowhere. Publishes on `bus` too unless it is null, with the run's number.
  // `unbuffered`: every message is on disk at once. `tail_ticks`: how many laps tail_offset() leaves.
  explicit Recorder(const std::string& log_path, lcm::LCM* bus = nullptr, bool unbuffered = false,
                    std::int64_t run_id = 0, std::int64_t tail_ticks = kTailTicks);

  void take(const Lap& lap) override;

  template <class M>
  void record(const char* channel, const M& message) {
    record_heard(channel, message, message.utime);
    if (bus_ == nullptr) return;
    M published = message;
    published.run_id = run_id_;
    publish(channel, published);
  }
  // A message that somebody else has published; stamped with the time of the lap in which it was heard.
  template <class M>
  void record_heard(const char* channel, const M& message, std::int64_t utime) {
    if (log_ && good()) bytes_ += log_->append(channel, message, utime);
  }

  // The byte of the log at which its last tail_ticks laps begin, or up to 2 kTailStride more laps; 0 if there are
  // fewer.
  [[nodiscard]] std::int64_t tail_offset() const { return tail_.empty() ? 0 : tail_.front(); }
  static constexpr std::int64_t kTailTicks = 4096, kTailStride = 64;
  static constexpr double kTailSeconds = 4;
  // kTailTicks, or the ticks of kTailSeconds where those are more.
  static std::int64_t tail_ticks(double control_period_s) {
    return std::max(kTailTicks, static_cast<std::int64_t>(std::ceil(kTailSeconds / control_period_s)));
  }

  [[nodiscard]] std::int64_t bytes() const override { return bytes_; }

  // Everything recorded is in the file, or this is false and error() says what is not.
  bool close();
  [[nodiscard]] bool good() const override { return bus_error_.empty() && (!log_ || log_->good()); }
  [[nodiscard]] bool bus_failed() const { return !bus_error_.empty(); }
  [[nodiscard]] const std::string& error() const override { return !log_ || log_->good() ? bus_error_ : log_->error(); }

 private:
  template <class M>
  void publish(const char* channel, const M& message) {
    buffer_.resize(hal::encoded_size(message));
    hal::encode(message, buffer_.data());
    publish_encoded(channel);
  }
  void mark_lap();
  void publish_encoded(const char* channel);

  std::optional<LogWriter> log_;
  lcm::LCM* bus_;
  std::int64_t run_id_, tail_ticks_;
  std::vector<char> buffer_;
  std::int64_t bytes_ = 0, laps_ = 0;
  std::deque<std::int64_t> tail_;
  std::string bus_error_;
};

}  // namespace ballast::sil
