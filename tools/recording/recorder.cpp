#include "tools/recording/recorder.h"

namespace ballast::sil {

Recorder::Recorder(const std::string& log_path, lcm::LCM* bus, bool unbuffered, std::int64_t run_id,
                   std::int64_t tail_ticks)
    : bus_(bus), run_id_(run_id), tail_ticks_(tail_ticks) {
  if (!log_path.empty()) log_.emplace(log_path, unbuffered);
}

void Recorder::take(const Lap& lap) {
  if (!log_ && bus_ == nullptr) return;
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

void Recorder::publish_encoded(const char* channel) {
  if (good() && bus_->publish(channel, buffer_.data(), static_cast<unsigned int>(buffer_.size())) != 0) {
    bus_error_ = "the LCM bus does not take messages any more";
  }
}

bool Recorder::close() {
  if (log_) log_->flush();
  return good();
}

}  // namespace ballast::sil
