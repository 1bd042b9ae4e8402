// The record of a run: every message, in LCM's event-log format, stamped with simulated time; and the bus, if there is
// one.
#pragma once

#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"

namespace ballast::sil {

class Recorder {
 public:
  // Writes to `log_path`, and publishes on `bus` unless it is null. `unbuffered`: every message is on disk at once.
  explicit Recorder(const std::string& log_path, lcm::LCM* bus = nullptr, bool unbuffered = false);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  template <class M>
  void record(const char* channel, const M& message) {
    encode(message);
    write(channel, message.utime, bus_);
  }
  // What somebody else has put on the bus; stamped with the time of the lap it was heard in.
  template <class M>
  void record_heard(const char* channel, const M& message, std::int64_t utime) {
    encode(message);
    write(channel, utime, nullptr);
  }

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
  void write(const char* channel, std::int64_t utime, lcm::LCM* bus);

  std::string log_path_;
  lcm_eventlog_t* log_ = nullptr;
  lcm::LCM* bus_;
  bool flush_;
  std::vector<char> buffer_;
  std::string error_;
};

}  // namespace ballast::sil
