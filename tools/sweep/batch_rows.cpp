#include "tools/sweep/batch_rows.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "sim/masses/motion.h"
#include "sim/plant/floor.h"
#include "sim/plant/plant.h"
#include "tools/program/program.h"
#include "tools/sweep/kept_values.h"

namespace ballast::sweep {
namespace {

// Relative distance from a limit within which the plant decides. The extrema agree to 1e-6.
constexpr double kNear = 2e-6;
// Largest difference between the extrema of batch and plant, relative to f_s / N and to the weight: a third of 1e-6,
// because the rows that are compared are a sample.
constexpr double kAgreement = 3e-7;
constexpr std::uint64_t kCompared = 16;  // rows
// The length of the attitude's quaternion drifts with the sixth power of the step times the rotation rate, its angle
// with the fifth. A row may have 4 times the drift of the rows that were compared, hence 4^(5/6) = 3.2 times their
// error of at most kAgreement: 1e-6. The floor is the rounding of some thousand steps.
constexpr double kMoreDrift = 4, kLeastDrift = 1e-12;
constexpr int kHalvings = 4;  // of the step, at most
// Values that no check of a scenario comes near to refusing.
constexpr double kLeast = 1e-9, kMost = 1e9;

bool moderate(double positive) { return positive > kLeast && positive < kMost; }

double weight_n(const BatchBall& ball, std::size_t masses, double gravity) {
  double mass = ball.shell_mass_kg;
  for (std::size_t i = 0; i < masses; ++i) mass += ball.mass_kg[i];
  return mass * gravity;
}

// The plant's run of a scenario on a floor that holds everything.
sil::RunResult rolled_by_plant(sim::Scenario scenario) {
  scenario.surface.static_friction = scenario.surface.kinetic_friction = std::numeric_limits<double>::infinity();
  return run_plant(scenario);
}

double drift_of(const BatchBall& ball, const BatchResult& rolled) {
  double squares = 0;
  for (const double q : ball.orientation) squares += q * q;
  return std::abs(rolled.orientation_length / std::sqrt(squares) - 1);
}

std::array<double, 3> array_of(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

}  // namespace

std::optional<BatchRows::Target> BatchRows::target_of(const std::string& key, const sim::Scenario& base) {
  if (key == "ball.mass") return Target{Field::kShellMass, 0};
  if (key == "surface.static_friction") return Target{Field::kFriction, 0};
  if (key == "initial.orientation") return Target{Field::kOrientation, 0};
  const std::size_t dot = key.rfind('.');
  if (dot == std::string::npos) return std::nullopt;
  const auto index_in = [](std::string_view text) {
    std::size_t index = SIZE_MAX;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
    return error == std::errc{} && end == text.data() + text.size() ? index : SIZE_MAX;
  };
  if (key.starts_with("mass.") && key.ends_with(".mass") && dot > 5) {
    const std::size_t index = index_in(std::string_view(key).substr(5, dot - 5));
    return index < base.masses.size() ? std::optional(Target{Field::kMass, index}) : std::nullopt;
  }
  const std::pair<std::string_view, Field> lists[] = {{"ball.inertia", Field::kInertia},
                                                      {"ball.center_of_mass", Field::kCenterOfMass},
                                                      {"external_force", Field::kForce},
                                                      {"initial.angular_velocity", Field::kRate},
                                                      {"initial.position", Field::kPosition}};
  for (const auto& [name, field] : lists) {
    const std::size_t index = index_in(std::string_view(key).substr(dot + 1));
    if (std::string_view(key).substr(0, dot) == name && index < 3) return Target{field, index};
  }
  return std::nullopt;
}

void BatchRows::set(const Target& target, const sim::Node& value, Lane& lane) {
  switch (target.field) {
    case Field::kShellMass:
      lane.ball.shell_mass_kg = value.number;
      return;
    case Field::kInertia:
      lane.ball.inertia_kgm2[target.index] = value.number;
      return;
    case Field::kCenterOfMass:
      lane.ball.center_of_mass_B_m[target.index] = value.number;
      return;
    case Field::kMass:
      lane.ball.mass_kg[target.index] = value.number;
      return;
    case Field::kForce:
      lane.ball.force_W_n[target.index] = value.number;
      return;
    case Field::kRate:
      lane.ball.angular_velocity_B_radps[target.index] = value.number;
      return;
    case Field::kPosition:
      lane.ball.position_W_m[target.index] = value.number;
      return;
    case Field::kFriction:
      lane.static_friction = value.number;
      return;
    case Field::kOrientation:
      for (std::size_t i = 0; i < 4; ++i)
        lane.ball.orientation[i] = i < value.items.size() ? value.items[i].number : std::nan("");
      return;
  }
}

bool BatchRows::fits(const Lane& lane) const {
  const BatchBall& b = lane.ball;
  bool good = moderate(b.shell_mass_kg) && lane.static_friction > kLeast;
  for (std::size_t i = 0; i < base_.masses.size(); ++i) good = good && moderate(b.mass_kg[i]);
  double all = 0, center = 0, attitude = 0;
  for (const double inertia : b.inertia_kgm2) {
    good = good && moderate(inertia);
    all += inertia;
  }
  for (const double inertia : b.inertia_kgm2) good = good && inertia < (all - inertia) * (1 + kLeast);
  for (const double c : b.center_of_mass_B_m) center += c * c;
  for (const double q : b.orientation) attitude += q * q;
  good = good && center < 0.999 * base_.ball.radius_m * base_.ball.radius_m && std::abs(attitude - 1) < kLeast;
  for (const double value : b.force_W_n) good = good && std::abs(value) < kMost;
  for (const double value : b.angular_velocity_B_radps) good = good && std::abs(value) < kMost;
  for (const double value : b.position_W_m) good = good && std::abs(value) < kMost;
  return good;
}

BatchRows::BatchRows(const Spec& spec, const RowScenarios& scenarios, Lanes lanes)
    : spec_(spec), scenarios_(scenarios), lanes_(lanes) {
  sim::ScenarioResult read = sim::parse_scenario(spec.base_toml, spec.base_name);
  if (!read.ok() || !plant_suffices(spec, scenarios, read.scenario)) return;
  base_ = std::move(read.scenario);
  const bool on_rails = std::all_of(base_.masses.begin(), base_.masses.end(),
                                    [](const sim::Mass& mass) { return mass.trajectory.times_s.empty(); });
  if (!sim::Floor(base_).ideal() || !base_.surface.patches.empty()) return;
  if (!on_rails || !(base_.gravity_mps2 > 0) || !base_.force_table.times_s.empty() || base_.drag.coefficient_kgpm > 0)
    return;
  for (const Variation& v : spec.vary) {
    const auto target = target_of(v.key, base_);
    if (!target) return;
    targets_.push_back(*target);
  }
  nominal_.ball.shell_mass_kg = base_.ball.mass_kg;
  nominal_.ball.inertia_kgm2 = array_of(base_.ball.inertia_kgm2);
  nominal_.ball.center_of_mass_B_m = array_of(base_.ball.center_of_mass_B_m);
  for (std::size_t i = 0; i < base_.masses.size(); ++i) nominal_.ball.mass_kg[i] = base_.masses[i].mass_kg;
  nominal_.ball.force_W_n = array_of(base_.external_force_W_n);
  const Eigen::Quaterniond& q = base_.initial.orientation;
  nominal_.ball.orientation = {q.w(), q.x(), q.y(), q.z()};
  nominal_.ball.angular_velocity_B_radps = array_of(base_.initial.angular_velocity_B_radps);
  nominal_.ball.position_W_m = {base_.initial.position_W_m[0], base_.initial.position_W_m[1]};
  nominal_.static_friction = base_.surface.static_friction;
  // Keys that [believed] leaves out follow the truth, which may be varied.
  if (scenarios.find("believed.surface.static_friction") != nullptr) {
    believed_friction_ = base_.belief().surface.static_friction;
  }
  choose_step();
}

BatchRows::Lane BatchRows::lane_of(Row row) const {
  Lane lane = nominal_;
  lane.row = std::move(row);
  for (std::size_t i = 0; i < targets_.size(); ++i) set(targets_[i], lane.row.values[i], lane);
  lane.fits = fits(lane);
  return lane;
}

bool BatchRows::agree(const BatchBall& ball, const BatchResult& rolled, const sim::ContactExtrema& truth) const {
  const double force = kAgreement * weight_n(ball, base_.masses.size(), base_.gravity_mps2);
  const double mu = truth.mu_required_max.value;
  return std::abs(rolled.normal_force_min.value - truth.normal_force_min.value) < force &&
         std::abs(rolled.normal_force_max.value - truth.normal_force_max.value) < force &&
         std::abs(rolled.static_friction_max.value - truth.static_friction_max.value) < force &&
         std::abs(rolled.mu_required_max.value - mu) < kAgreement * mu;
}

bool BatchRows::agrees(double step_s, const std::vector<Lane>& rows, const std::vector<sil::RunResult>& truth) {
  const MotionTable table(base_, step_s);
  RollingBatch batch(table, lanes_);
  most_drift_ = kLeastDrift / kMoreDrift;
  for (std::size_t begin = 0; begin < rows.size(); begin += kLanes) {
    std::array<BatchBall, kLanes> balls;
    for (std::size_t l = 0; l < kLanes; ++l) balls[l] = rows[std::min(begin + l, rows.size() - 1)].ball;
    std::array<BatchResult, kLanes> results;
    batch.roll(balls, results);
    for (std::size_t l = 0; l < kLanes && begin + l < rows.size(); ++l) {
      if (!agree(balls[l], results[l], truth[begin + l].extrema)) return false;
      most_drift_ = std::max(most_drift_, drift_of(balls[l], results[l]));
    }
  }
  return true;
}

void BatchRows::choose_step() {
  std::vector<Lane> rows;
  std::vector<sil::RunResult> truth;
  constexpr std::uint64_t kTried = 8;  // rows from each place on
  std::uint64_t next = 0;
  for (std::uint64_t i = 0; i < kCompared; ++i) {
    // Not i * rows / kCompared, which overflows.
    const std::uint64_t place = spec_.rows() / kCompared * i + spec_.rows() % kCompared * i / kCompared;
    for (std::uint64_t number = std::max(next, place); number < std::min(place + kTried, spec_.rows()); ++number) {
      next = number + 1;
      Lane lane = lane_of(make_row(spec_, number));
      const sim::ScenarioResult read = scenarios_.make(lane.row);
      if (!lane.fits || !read.ok()) continue;
      sil::RunResult result = rolled_by_plant(read.scenario);
      if (result.end_reason != sil::EndReason::kCompleted) continue;
      rows.push_back(std::move(lane));
      truth.push_back(std::move(result));
      break;
    }
  }
  if (rows.empty()) return;
  step_s_ = 0.02 * std::sqrt(base_.ball.radius_m / base_.gravity_mps2);
  for (int halvings = 0; halvings <= kHalvings; ++halvings, step_s_ /= 2) {
    if (!agrees(step_s_, rows, truth)) continue;
    table_.emplace(base_, step_s_);
    batch_.emplace(*table_, lanes_);
    break;
  }
  sim::PrescribedMasses motion(base_.masses);
  motion.enter_pieces(base_.duration_s);
  const sim::MassPoint end = motion.at(base_.duration_s);
  result_.end_reason = sil::EndReason::kCompleted;
  result_.final_sample.time_s = base_.duration_s;
  result_.final_sample.mass_position = end.position;
  result_.final_sample.mass_velocity = end.velocity;
}

std::optional<RowResult> BatchRows::result_of(const Lane& lane, const BatchResult& rolled) {
  const double weight = weight_n(lane.ball, base_.masses.size(), base_.gravity_mps2);
  const double mu = rolled.mu_required_max.value, believed = believed_friction_.value_or(lane.static_friction),
               allowed = base_.envelope.friction_use * believed;
  const bool rolls = rolled.normal_force_min.value > base_.envelope.min_normal_force_n + kNear * weight &&
                     mu < (1 - kNear) * lane.static_friction;
  const bool decided = std::isinf(allowed) || std::abs(mu - allowed) > kNear * allowed;
  const bool accurate = drift_of(lane.ball, rolled) <= kMoreDrift * most_drift_;
  if (!rolls || !decided || !accurate) return std::nullopt;

  const auto extremum = [](const BatchExtremum& e) { return sim::Extremum{e.value, e.time_s}; };
  result_.extrema = {extremum(rolled.mu_required_max), extremum(rolled.normal_force_min),
                     extremum(rolled.normal_force_max), extremum(rolled.static_friction_max)};
  sim::Sample& f = result_.final_sample;
  const Eigen::Map<const Eigen::Vector3d> omega(rolled.angular_velocity_B_radps.data());
  f.orientation = Eigen::Map<const Eigen::Vector4d>(rolled.orientation.data());
  f.angular_velocity_B_radps = omega;
  f.position_W_m = {rolled.position_W_m[0], rolled.position_W_m[1], 0};
  const Eigen::Quaterniond q(f.orientation[0], f.orientation[1], f.orientation[2], f.orientation[3]);
  f.velocity_W_mps = base_.ball.radius_m * (q * omega).cross(Eigen::Vector3d::UnitZ());
  base_.surface.static_friction = lane.static_friction;

  RowResult out;
  out.number = lane.row.number;
  out.seed = lane.row.seed;
  out.exit_status = mu > allowed ? program::kExitEnvelope : program::kExitCompleted;
  for (const sim::Node& value : lane.row.values) out.varied.push_back(to_cell(value));
  out.kept = kept_plant_values(spec_.keep, base_, result_);
  return out;
}

std::vector<RowResult> BatchRows::run(const std::vector<Row>& rows) {
  std::vector<RowResult> out;
  out.reserve(rows.size());
  for (std::size_t begin = 0; begin < rows.size(); begin += kLanes) {
    const std::size_t used = std::min(kLanes, rows.size() - begin);
    std::array<Lane, kLanes> lanes;
    std::array<BatchBall, kLanes> balls;
    for (std::size_t l = 0; l < kLanes; ++l) {
      if (l < used) lanes[l] = lane_of(rows[begin + l]);
      balls[l] = lanes[l].fits ? lanes[l].ball : nominal_.ball;  // a lane that is not used must do no harm
    }
    std::array<BatchResult, kLanes> rolled;
    batch_->roll(balls, rolled);
    for (std::size_t l = 0; l < used; ++l) {
      std::optional<RowResult> row;
      if (lanes[l].fits) row = result_of(lanes[l], rolled[l]);
      out.push_back(row ? std::move(*row) : run_row(spec_, scenarios_, lanes[l].row));
    }
  }
  return out;
}

}  // namespace ballast::sweep
