#include "tools/sil/trip_watch.h"

namespace ballast::sil {

void TripWatch::observe(const Lap& lap, const trip_t& trip) {
  stopping_ = false;
  if (!has_controller_) {
    if (trip.tripped != 0 && !latency_ticks_) latency_ticks_ = lap.tick() - trip.trip_tick;
    return;
  }
  if (!lap.answer) return;
  if (history_.size() == kHistoryTicks) history_.pop_front();
  history_.push_back(lap.answer->steps);
  const controller_status_t& status = lap.answer->status;
  const bool disarmed = status.mode == controller_status_t::MODE_DISARMED;
  armed_ = armed_ || !disarmed;
  // A controller that is still disarmed has nothing to stop and will not start, after a trip or where a fault keeps it
  // from arming. Such a fault is no trip of its own, since nothing moves.
  const bool will_not_start = disarmed && (trip.tripped != 0 || (!armed_ && status.faults != 0));
  stopping_ = status.mode == controller_status_t::MODE_TRIPPED || will_not_start;
  if (stopping_) {
    observe_stop(lap, trip);
  } else if (armed_) {
    done_tick_.reset();  // an operator has released it: another trip begins another stop
  }
}

void TripWatch::observe_stop(const Lap& lap, const trip_t& trip) {
  const controller_status_t& status = lap.answer->status;
  if (trip.tripped != 0 && !latency_ticks_) latency_ticks_ = lap.tick() + 1 - trip.trip_tick;
  if (!controller_trip_) {
    controller_trip_ = {status.faults, lap.tick(),        lap.plant.contact.time_s,
                        status,        lap.plant.sensors, {history_.begin(), history_.end()}};
  }
  // The masses are at rest from the next tick on, whose steps are still to be executed.
  if (status.at_rest != 0 && !done_tick_) done_tick_ = lap.tick() + 2;
}

}  // namespace ballast::sil
