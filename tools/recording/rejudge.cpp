#include "tools/recording/rejudge.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/plant/contact_regime.h"
#include "tools/faults/injection.h"
#include "tools/sil/plant_messages.h"

namespace ballast::sil {

namespace {

// Some roundings of numbers that are as large as these.
constexpr double kRounding = 1e-9;
// In radii. The plant locates a crossing better than this.
constexpr double kBorder = 1e-9;

bool near(double a, double b, double scale) {
  return a == b || (std::isfinite(scale) && std::abs(a - b) <= kRounding * scale);
}

// Equal, or NaN both.
bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)) || near(a, b, std::abs(b)); }

bool same_verdict(const trip_t& a, const trip_t& b) {
  return a.tick == b.tick && a.utime == b.utime && a.tripped == b.tripped && a.cause == b.cause &&
         a.trip_tick == b.trip_tick && a.trip_time_s == b.trip_time_s && a.value == b.value && a.limit == b.limit &&
         a.scenario_id == b.scenario_id;
}

}  // namespace

Rejudge::Rejudge(const sim::Scenario& scenario, const monitor::MonitorLimits& limits)
    : scenario_(scenario),
      turned_part_(limits.turned_part),
      sensors_are_true_(std::ranges::none_of(
          scenario.faults, [](const sim::Fault& fault) { return fault.of(sim::FaultLayer::kSensor); })),
      floor_is_known_(std::ranges::none_of(
          scenario.faults, [](const sim::Fault& fault) { return fault.kind == sim::FaultKind::kFrictionFalls; })),
      floor_(scenario.surface) {
  if (!has_peer_faults(scenario)) monitor_ = std::make_unique<LocalMonitor>(limits);
}

void Rejudge::observe(const Lap& recorded) {
  tick_ = recorded.tick();
  found_ = false;
  check_time(recorded);
  check_forces(recorded.plant.contact, Eigen::Vector2d::Map(recorded.plant.state.position_W_m));
  check_state(recorded);
  check_sensors(recorded);
  check_verdict(recorded);  // last: a wrong message of the plant can be why
  ticks_with_findings_ += found_;
}

void Rejudge::expect(bool good, const std::string& text) {
  if (good) return;
  found_ = true;
  if (!first_) first_ = Misjudged{tick_, text};
}

void Rejudge::check_verdict(const Lap& recorded) {
  if (!monitor_) return;
  Lap again = recorded;
  monitor_->judge(again);
  monitor_->hear(recorded);
  if (!recorded.verdict) return;
  const trip_t &was = *recorded.verdict, &is = *again.verdict;
  expect(
      same_verdict(was, is),
      fmt::format("the monitor says tripped {}, cause {}, tick {}, time {:.9g} s, value {:.9g}, limit {:.9g}; recorded "
                  "is {}, {}, {}, {:.9g} s, {:.9g}, {:.9g}",
                  is.tripped, is.cause, is.trip_tick, is.trip_time_s, is.value, is.limit, was.tripped, was.cause,
                  was.trip_tick, was.trip_time_s, was.value, was.limit));
}

void Rejudge::check_time(const Lap& recorded) {
  const contact_t& contact = recorded.plant.contact;
  const double period_s = scenario_.run.control_period_s;
  const double due_s = tick_ < 0 ? 0 : static_cast<double>(tick_) * period_s;
  const bool ends_between = contact.last != 0 && contact.time_s <= due_s && contact.time_s > due_s - period_s;
  expect(contact.time_s == due_s || ends_between || (contact.last != 0 && near(contact.time_s, due_s, due_s)),
         fmt::format("contact time_s is {:.17g} where {:.17g} is due", contact.time_s, due_s));
  expect(recorded.plant.state.time_s == contact.time_s,
         fmt::format("plant_state time_s is {:.17g}, that of contact {:.17g}", recorded.plant.state.time_s,
                     contact.time_s));
  const std::int64_t utime =
      tick_ < 0 ? hal::tick_utime(tick_, period_s) : static_cast<std::int64_t>(std::llround(contact.time_s * 1e6));
  const bool stamped =
      contact.utime == utime && recorded.plant.state.utime == utime && recorded.plant.sensors.utime == utime;
  expect(stamped, fmt::format("a utime of contact, plant_state and sensors is not {}", utime));
  expect(contact.last == recorded.plant.state.last && contact.last == recorded.plant.sensors.last,
         "contact, plant_state and sensors do not agree whether they are the last");
}

void Rejudge::check_forces(const contact_t& contact, const Eigen::Vector2d& place_W_m) {
  const double n = contact.normal_force_n, f_s = contact.static_friction_n;
  const double force_n = std::hypot(contact.friction_force_W_n[0], contact.friction_force_W_n[1]);
  expect(std::abs(force_n - f_s) <= std::max(kRounding, turned_part_) * (force_n + f_s + std::abs(n)),
         fmt::format("|friction_force_W_n| is {:.9g} N, static_friction_n {:.9g} N", force_n, f_s));
  const bool flies = contact.regime == contact_t::REGIME_FLIGHT;
  expect(!flies || (n == 0 && f_s == 0), fmt::format("in flight N is {:.9g} N and f_s {:.9g} N", n, f_s));
  const double mu = flies ? 0 : sim::mu_required(n, f_s);
  expect(same(contact.mu_required, mu),
         fmt::format("mu_required is {:.9g}; N and f_s make {:.9g}", contact.mu_required, mu));
  const std::int64_t answered = scenario_.sensors.attitude_estimated ? tick_ - 1 : tick_;
  expect(contact.commanded_tick == answered,
         fmt::format("commanded_tick is {} where {} is due", contact.commanded_tick, answered));
  if (std::isnan(contact.commanded_normal_force_n)) {
    expect(std::isnan(contact.commanded_static_friction_n) && std::isnan(contact.commanded_mu_required),
           "the commanded_ fields are NaN in part");
  } else {
    expect(!std::isnan(contact.commanded_static_friction_n), "the commanded_ fields are NaN in part");
    const double commanded =
        flies ? 0 : sim::mu_required(contact.commanded_normal_force_n, contact.commanded_static_friction_n);
    expect(same(contact.commanded_mu_required, commanded),
           fmt::format("commanded_mu_required is {:.9g}; N and f_s make {:.9g}", contact.commanded_mu_required,
                       commanded));
  }
  floor_.stand_at(place_W_m);
  // Where the ball stands within the errors of a border, either side may have been meant.
  if (floor_is_known_ && !(std::abs(floor_.overdue_m(place_W_m)) < kBorder * scenario_.ball.radius_m)) {
    const double margin = friction_margin(n, f_s, floor_.static_friction());
    expect(near(contact.margin, margin, 1),
           fmt::format("margin is {:.9g}; N and f_s make {:.9g}", contact.margin, margin));
  }
  expect(contact.normal_force_min_n <= n + kRounding * std::abs(n),
         fmt::format("normal_force_min_n {:.9g} N is above N {:.9g} N", contact.normal_force_min_n, n));
  expect(
      contact.mu_required_max >= contact.mu_required * (1 - kRounding),
      fmt::format("mu_required_max {:.9g} is below mu_required {:.9g}", contact.mu_required_max, contact.mu_required));
}

void Rejudge::check_state(const Lap& recorded) {
  const plant_state_t& state = recorded.plant.state;
  const double* q = state.orientation;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  expect(near(length, 1, 1), fmt::format("the orientation's length is {:.12g}", length));
  const double r = scenario_.ball.radius_m;
  if (recorded.plant.contact.regime == contact_t::REGIME_ROLLING) {
    const Eigen::Vector3d omega_W =
        Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Vector3d(state.angular_velocity_B_radps[0],
                                                                     state.angular_velocity_B_radps[1],
                                                                     state.angular_velocity_B_radps[2]);
    const Eigen::Vector3d velocity(state.velocity_W_mps[0], state.velocity_W_mps[1], state.velocity_W_mps[2]);
    const Eigen::Vector3d rolls = omega_W.cross(Eigen::Vector3d(0, 0, r));
    expect((velocity - rolls).norm() <= kRounding * r * omega_W.norm(),
           "velocity_W_mps is not that of a ball which rolls with angular_velocity_B_radps");
    expect(near(state.position_W_m[2], 0, r), fmt::format("the ball rolls at height {:.9g} m", state.position_W_m[2]));
  }
  expect(state.mass_count == static_cast<std::int8_t>(scenario_.masses.size()),
         fmt::format("mass_count is {}", state.mass_count));
  Eigen::Vector3d moment = scenario_.ball.mass_kg * scenario_.ball.center_of_mass_B_m;
  double mass_kg = scenario_.ball.mass_kg;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const sim::Mass& mass = scenario_.masses[i];
    const Eigen::Vector3d place(state.mass_position_B_m[i][0], state.mass_position_B_m[i][1],
                                state.mass_position_B_m[i][2]);
    moment += mass.mass_kg * place;
    mass_kg += mass.mass_kg;
    if (!mass.trajectory.times_s.empty()) continue;
    const auto on_rail = firmware::evaluate(mass.rail, state.mass_position[i]).position;
    const double off_m = (place - Eigen::Vector3d(on_rail)).norm();
    expect(off_m <= kRounding * r, fmt::format("mass {} is {:.9g} m off its rail's place", i, off_m));
  }
  const Eigen::Vector3d center(state.center_of_mass_B_m[0], state.center_of_mass_B_m[1], state.center_of_mass_B_m[2]);
  expect((center - moment / mass_kg).norm() <= kRounding * r, "center_of_mass_B_m is not that of shell and masses");
}

void Rejudge::check_sensors(const Lap& recorded) {
  const plant_state_t& state = recorded.plant.state;
  const sensors_t& sensors = recorded.plant.sensors;
  expect(sensors.mass_count == state.mass_count, fmt::format("the sensors' mass_count is {}", sensors.mass_count));
  const bool estimated = scenario_.sensors.attitude_estimated;
  expect(sensors.attitude_valid == (estimated ? 0 : 1),
         fmt::format("attitude_valid is {} where the attitude is {}", sensors.attitude_valid,
                     estimated ? "estimated" : "sensed"));
  if (!sensors_are_true_) return;
  expect(std::equal(std::begin(sensors.orientation), std::end(sensors.orientation),
                    estimated ? kNoAttitude : state.orientation),
         estimated ? "the sensors have an orientation, which nothing senses"
                   : "the sensors' orientation is not the plant state's");
  expect(sensors.imu_count == 0 || sensors.imu_tick <= sensors.tick, "imu_tick is still to come");
  expect(sensors.fix_count == 0 || sensors.fix_tick <= sensors.tick, "fix_tick is still to come");
  if (scenario_.sensors.present) return;  // the attitude is sensed, the rate measured with errors
  expect(std::equal(std::begin(sensors.gyro_B_radps), std::end(sensors.gyro_B_radps), state.angular_velocity_B_radps),
         "gyro_B_radps is not the plant state's angular velocity");
}

}  // namespace ballast::sil
