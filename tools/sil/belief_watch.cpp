#include "tools/sil/belief_watch.h"

namespace ballast::sil {

namespace {

// The faults of the world are no belief.
sim::PlantModel believed_model(const sim::Scenario& scenario) {
  sim::PlantModel model = scenario;
  static_cast<sim::World&>(model) = scenario.belief();
  if (sim::has_controller(model.actuation)) model.actuation = sim::Actuation::kIdeal;
  model.faults.clear();
  return model;
}

}  // namespace

BeliefWatch::BeliefWatch(const sim::Scenario& scenario)
    : has_controller_(sim::has_controller(scenario.run.actuation)), plant_(believed_model(scenario)) {
  rows_.reserve(kMostRows + 1);
  keep_row();
}

void BeliefWatch::begin_tick(const controller_status_t* at_start, const controller_status_t* at_end, double end_s) {
  if (!has_controller_ || lost_) return;
  lost_ = at_start == nullptr || at_end == nullptr;
  if (lost_) return;
  plant_.place_masses(at_start->next_position, at_start->next_velocity, at_start->next_acceleration);
  plant_.lead_masses(end_s, at_end->next_position, at_end->next_velocity);
}

void BeliefWatch::follow(double time_s) {
  if (lost_ || time_s <= plant_.time_s()) return;
  plant_.advance(time_s, {});
  if (++ticks_ % every_ == 0) keep_row();
}

void BeliefWatch::keep_row() {
  const sim::Plant::Sample sample = plant_.sample();
  rows_.push_back({sample.time_s, sample.position_W_m.head<2>(), sample.normal_force_n, sample.static_friction_n});
  if (rows_.size() < kMostRows) return;
  for (std::size_t i = 1; 2 * i < rows_.size(); ++i) rows_[i] = rows_[2 * i];
  rows_.resize((rows_.size() + 1) / 2);
  every_ *= 2;
}

BeliefPrediction BeliefWatch::result() const {
  BeliefPrediction found{plant_.time_s(), plant_.end(), plant_.extrema(), plant_.sample().position_W_m, rows_};
  if (found.rows.back().time_s < found.time_s) {
    const sim::Plant::Sample last = plant_.sample();
    found.rows.push_back({last.time_s, last.position_W_m.head<2>(), last.normal_force_n, last.static_friction_n});
  }
  return found;
}

}  // namespace ballast::sil
