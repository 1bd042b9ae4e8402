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
    : has_controller_(sim::has_controller(scenario.run.actuation)), plant_(believed_model(scenario)) {}

void BeliefWatch::begin_tick(const controller_status_t* at_start, const controller_status_t* at_end, double end_s) {
  if (!has_controller_ || lost_) return;
  lost_ = at_start == nullptr || at_end == nullptr;
  if (lost_) return;
  plant_.place_masses(at_start->next_position, at_start->next_velocity, at_start->next_acceleration);
  plant_.lead_masses(end_s, at_end->next_position, at_end->next_velocity);
}

void BeliefWatch::follow(double time_s) {
  if (!lost_ && time_s > plant_.time_s()) plant_.advance(time_s, {});
}

BeliefPrediction BeliefWatch::result() const {
  return {plant_.time_s(), plant_.end(), plant_.extrema(), plant_.sample().position_W_m};
}

}  // namespace ballast::sil
