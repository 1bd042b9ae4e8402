#include "tools/tracking/followed_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "sim/scenario/fingerprint.h"
#include "tools/tracking/reference.h"

namespace ballast::plan {
namespace {

// Weights of the controller, chosen by the study of tracking.md. A smaller one of the place follows a desk ball more
// closely, and loses a ball that starts balanced on its head with masses 5 % off.
TrackingOptions controller_options() {
  TrackingOptions options;
  options.weights.place = 0.07;
  options.weights.place_integral = 0.5;
  options.weights.about_vertical = 0.01;
  options.holds = true;
  options.lenient = true;
  return options;
}

// Everything that reference and gains depend on, and nothing else.
std::int64_t key_of(const sim::Scenario& planned) {
  sim::Scenario key = planned;
  key.name.clear();
  key.seed = 0;
  key.envelope = {};
  key.sensors = {};
  key.run.actuation = sim::Actuation::kPrescribed;
  key.run.hold_s = 0;
  key.control = {};
  return sim::fingerprint(key);
}

struct Kept {
  std::int64_t key = 0;  // 0: nothing
  std::string why;
  firmware::ReferenceTable table;
};

void compute(const sim::Scenario& planned, const firmware::BallParams& ball, Kept& out) {
  out.why.clear();
  const auto tracking = track(planned, ball, out.why, controller_options());
  if (!tracking) return;
  const GainTable gains = gain_table(*tracking);
  out.table = {};
  out.table.samples = gains.samples;
  out.table.period_s = gains.period_s;
  out.table.holds = tracking->ends_at_rest;
  std::copy(gains.values.begin(), gains.values.end(), out.table.values.begin());
}

}  // namespace

sim::Scenario as_planned(const sim::Scenario& scenario) {
  sim::Scenario planned = sim::as_believed(scenario);
  planned.initial.has_velocity = false;
  planned.initial.height_m = 0;
  if (scenario.plan.start) {
    planned.initial.orientation = scenario.plan.start->orientation;
    planned.initial.angular_velocity_B_radps = scenario.plan.start->angular_velocity_B_radps;
    planned.initial.position_W_m = scenario.plan.start->position_W_m;
  }
  planned.faults.clear();
  planned.force_table = {};
  planned.drag = {};
  planned.surface.static_friction = planned.surface.kinetic_friction = std::numeric_limits<double>::infinity();
  return planned;
}

double motion_end_s(const sim::Scenario& scenario) {
  double end_s = 0;
  for (const sim::Mass& mass : scenario.masses) {
    double mass_s = 0;
    for (const sim::MotionPiece& piece : mass.motion) mass_s += piece.duration_s;
    end_s = std::max(end_s, mass_s);
  }
  return end_s;
}

std::optional<std::string> set_reference(const sim::Scenario& scenario, const firmware::BallParams& ball,
                                         firmware::ReferenceTable& table) {
  thread_local const auto kept = std::make_unique<Kept>();
  const sim::Scenario planned = as_planned(scenario);
  const std::int64_t key = key_of(planned);
  if (key != kept->key) {
    compute(planned, ball, *kept);
    kept->key = key;
  }
  if (!kept->why.empty()) return kept->why;
  table = kept->table;
  return std::nullopt;
}

Eigen::Vector2d PlannedPath::place_at(double time_s) const {
  const auto last = static_cast<double>(place_W_m.size() - 1);
  const double at = std::clamp(time_s / step_s, 0.0, last);
  const std::size_t from = std::min(static_cast<std::size_t>(at), place_W_m.size() - 2);
  const double s = at - static_cast<double>(from);
  return (1 + 2 * s) * (1 - s) * (1 - s) * place_W_m[from] + s * s * (3 - 2 * s) * place_W_m[from + 1] +
         step_s * s * (1 - s) * ((1 - s) * velocity_W_mps[from] - s * velocity_W_mps[from + 1]);
}

double PlannedPath::distance_m(const Eigen::Vector2d& place) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < place_W_m.size(); ++k) {
    const Eigen::Vector2d chord = place_W_m[k] - place_W_m[k - 1], from = place - place_W_m[k - 1];
    const double length2 = chord.squaredNorm();
    const double part = length2 > 0 ? std::clamp(from.dot(chord) / length2, 0.0, 1.0) : 0;
    nearest = std::min(nearest, (from - part * chord).squaredNorm());
  }
  return std::sqrt(nearest);
}

double PlannedPath::length_m() const {
  double length = 0;
  for (std::size_t k = 1; k < place_W_m.size(); ++k) length += (place_W_m[k] - place_W_m[k - 1]).norm();
  return length;
}

std::optional<PlannedPath> planned_path(const sim::Scenario& scenario) {
  const sim::Scenario planned = as_planned(scenario);
  const double g = planned.gravity_mps2, r = planned.ball.radius_m;
  const double unit_s = g > 0 ? std::sqrt(r / g) : 1;
  constexpr double kPart = 0.1;  // of sqrt(r / g): a cubic over it is exact to 1e-6 of the way
  const int steps = static_cast<int>(std::clamp(std::ceil(planned.duration_s / (kPart * unit_s)), 2.0, 20000.0));
  const auto points = roll_motion(planned, steps);
  if (points.size() < 2) return std::nullopt;
  PlannedPath path;
  path.step_s = planned.duration_s / steps;
  for (const ReferencePoint& point : points) {
    const Vec spin = to_space(point.state.q, point.state.omega_B);
    path.place_W_m.emplace_back(point.place_m[0], point.place_m[1]);
    path.velocity_W_mps.emplace_back(r * spin.y, -r * spin.x);
  }
  return path;
}

}  // namespace ballast::plan
