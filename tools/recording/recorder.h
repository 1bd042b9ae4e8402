// The record of a run: every message in LCM's event-log format, stamped with simulated time, and on the bus if there is
// one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"
#include "tools/sil/lap_sink.h"

namespace ballast::sil {

class Recorder final : public LapSink {
 public:
  // Writes to `log_path`; empty: nowhere. Publishes on `bus` too unless it is null, with the run's number.
  // `unbuffered`: every message is on disk at once. `tail_ticks`: how many laps tail_offset() leaves.
  explicit Recorder(const std::string& log_path, lcm::LCM* bus = nullptr, bool unbuffered = false,
                    std::int64_t run_id = 0, std::int64_t tail_ticks = kTailTicks);
  ~Recorder() override;
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void take(const Lap& lap) override;

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
  // A message that somebody else has published; stamped with the time of the lap in which it was heard.
  template <class M>
  void record_heard(const char* channel, const M& message, std::int64_t utime) {
    encode(message);
    write(channel, utime);
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

  // Flushes. False once anything could not be written; error() says what.
  bool close();
  [[nodiscard]] bool good() const override { return error_.empty(); }
  [[nodiscard]] const std::string& error() const override { return error_; }

 private:
  template <class M>
  void encode(const M& message) {
    const int size = message.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));
    message.encode(buffer_.data(), 0, size);
  }
  void mark_lap();
  void write(const char* channel, std::int64_t utime);
  void publish(const char* channel);

  std::string log_path_;
  lcm_eventlog_t* log_ = nullptr;
  lcm::LCM* bus_;
  bool flush_;
  std::int64_t run_id_, tail_ticks_;
  std::vector<char> buffer_;
  std::int64_t bytes_ = 0, laps_ = 0;
  std::deque<std::int64_t> tail_;
  std::string error_;
};

}  // namespace ballast::sil
