#include "tools/recording/recorder.h"

#include <stdio_ext.h>

#include <cerrno>
#include <cstring>

namespace ballast::sil {

namespace {

// An event of LCM's log begins with a sync word, number, time and two lengths.
constexpr std::int64_t kEventHeaderSize = 28;

}  // namespace

Recorder::Recorder(const std::string& log_path, lcm::LCM* bus, bool unbuffered, std::int64_t run_id,
                   std::int64_t tail_ticks)
    : log_path_(log_path), bus_(bus), flush_(unbuffered), run_id_(run_id), tail_ticks_(tail_ticks) {
  if (log_path.empty()) return;
  log_ = lcm_eventlog_create(log_path.c_str(), "w");
  if (log_ == nullptr) {
    error_ = log_path + ": cannot be written: " + std::strerror(errno);
    return;
  }
  setvbuf(log_->f, nullptr, _IOFBF, 1 << 16);
  __fsetlocking(log_->f, FSETLOCKING_BYCALLER);  // liblcm writes an event in six pieces; only this object writes
}

Recorder::~Recorder() { close(); }

void Recorder::take(const Lap& lap) {
  if (log_ == nullptr && bus_ == nullptr) return;
  mark_lap();
  if (lap.command) record(hal::kChannelOperator, *lap.command);
  for (const operator_t& heard : lap.heard) record_heard(hal::kChannelOperator, heard, lap.plant.contact.utime);
  record(hal::kChannelContact, lap.plant.contact);
  record(hal::kChannelPlantState, lap.plant.state);
  record(hal::kChannelSensors, lap.plant.sensors);
  if (lap.verdict) record(hal::kChannelTrip, *lap.verdict);
  if (!lap.answer) return;
  record(hal::kChannelControllerStatus, lap.answer->status);
  record(hal::kChannelStepCommand, lap.answer->steps);
}

// Keeps where laps begin, so that the log's end can be cut off at the beginning of one.
void Recorder::mark_lap() {
  const bool marked = laps_ % kTailStride == 0;
  ++laps_;
  if (!marked) return;
  tail_.push_back(bytes_);
  if (static_cast<std::int64_t>(tail_.size()) > (tail_ticks_ - 1) / kTailStride + 2) tail_.pop_front();
}

void Recorder::write(const char* channel, std::int64_t utime) {
  if (!good()) return;
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
  // Keeps what was written before anything failed, as far as there is room for it.
  if ((std::fflush(log_->f) != 0 || std::ferror(log_->f) != 0) && good()) {
    error_ = log_path_ + ": cannot be written: " + std::strerror(errno);
  }
  lcm_eventlog_destroy(log_);
  log_ = nullptr;
  return good();
}

}  // namespace ballast::sil
