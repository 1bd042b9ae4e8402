#include "tools/recording/recorder.h"

#include <stdio_ext.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace ballast::sil {

namespace {

constexpr std::int64_t kEventHeaderSize = 28;  // of LCM's event log: sync word, number, time, two lengths

}  // namespace

Recorder::Recorder(const std::string& log_path, lcm::LCM* bus, bool unbuffered, std::int64_t run_id,
                   std::int64_t tail_ticks)
    : log_path_(log_path), bus_(bus), flush_(unbuffered), run_id_(run_id), tail_ticks_(tail_ticks) {
  log_ = lcm_eventlog_create(log_path.c_str(), "w");
  if (log_ == nullptr) {
    error_ = log_path + ": cannot be written: " + std::strerror(errno);
    return;
  }
  setvbuf(log_->f, nullptr, _IOFBF, 1 << 16);
  __fsetlocking(log_->f, FSETLOCKING_BYCALLER);  // liblcm writes an event in six pieces; only this object writes
}

Recorder::~Recorder() { close(); }

void Recorder::write(const char* channel, std::int64_t utime) {
  if (!good()) return;
  if (utime >= full_utime_) {
    char asked[48];
    std::snprintf(asked, sizeof asked, " (as asked: disk_full at %.6g s)", 1e-6 * static_cast<double>(full_utime_));
    error_ = log_path_ + ": cannot be written: " + std::strerror(ENOSPC) + asked;
    return;
  }
  if (log_ != nullptr) {
    lcm_eventlog_event_t event{};
    event.timestamp = utime;
    event.channellen = static_cast<std::int32_t>(std::strlen(channel));
    event.datalen = static_cast<std::int32_t>(buffer_.size());
    event.channel = const_cast<char*>(channel);  // liblcm only reads it
    event.data = buffer_.data();
    if (lcm_eventlog_write_event(log_, &event) != 0)
      error_ = log_path_ + ": cannot be written: " + std::strerror(errno);
    bytes_ += kEventHeaderSize + event.channellen + event.datalen;
    if (flush_ && std::fflush(log_->f) != 0) error_ = log_path_ + ": cannot be written: " + std::strerror(errno);
  }
}

void Recorder::publish(const char* channel) {
  if (good() && bus_->publish(channel, buffer_.data(), static_cast<unsigned int>(buffer_.size())) != 0) {
    error_ = "the LCM bus does not take messages any more";
  }
}

bool Recorder::close() {
  if (log_ == nullptr) return good();
  // What was written before anything failed is worth keeping, as far as there is room for it.
  if ((std::fflush(log_->f) != 0 || std::ferror(log_->f) != 0) && good()) {
    error_ = log_path_ + ": cannot be written: " + std::strerror(errno);
  }
  lcm_eventlog_destroy(log_);
  log_ = nullptr;
  return good();
}

}  // namespace ballast::sil
