#include "tools/plan/plant_check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/plant/local_floor.h"

namespace ballast::plan {

sim::Scenario with_motion(const sim::Scenario& scenario, const Grid& grid, const std::vector<double>& knots) {
  sim::Scenario out = scenario;
  const std::size_t n = scenario.masses.size();
  for (std::size_t i = 0; i < n; ++i) {
    auto& motion = out.masses[i].motion;
    motion.clear();
    for (std::size_t j = 0; j + 1 < static_cast<std::size_t>(grid.knots()); ++j) {
      motion.push_back({grid.piece_s(), knots[j * n + i], knots[(j + 1) * n + i]});
    }
  }
  out.duration_s = grid.duration_s;
  out.run.actuation = sim::Actuation::kPrescribed;
  out.faults.clear();
  return out;
}

std::vector<std::vector<sim::MotionPiece>> stretched_motion(const sim::Scenario& scenario, const Grid& grid,
                                                            const std::vector<double>& knots, double duration_s) {
  const double ratio = duration_s / grid.duration_s;
  std::vector<std::vector<sim::MotionPiece>> out;
  for (const sim::Mass& mass : with_motion(scenario, grid, knots).masses) {
    out.push_back(mass.motion);
    for (sim::MotionPiece& piece : out.back()) {
      piece.duration_s *= ratio;
      piece.acceleration_start /= ratio * ratio;
      piece.acceleration_end /= ratio * ratio;
    }
  }
  return out;
}

namespace {

// Follows the plant to time_s. On a floor with patches the greatest f_s / N of each short stretch counts with the
// greater weight of its ends.
void follow(const PatchedFloor& floor, double time_s, sim::Plant& plant, double& need) {
  constexpr int kLooks = 12;
  const double start_s = plant.time_s();
  if (!floor.has_patches() || !(time_s > start_s)) return plant.advance(time_s, {});
  const auto weight = [&] { return floor.weight_at(plant.sample().position_W_m.head<2>()); };
  double before = weight();
  for (int look = 1; look <= kLooks && plant.end() == sim::PhysicsEnd::kNone; ++look) {
    plant.advance(look == kLooks ? time_s : start_s + (time_s - start_s) * look / kLooks, {});
    const double after = weight();
    need = std::max(need, std::max(before, after) * plant.sample().mu_required_max);
    before = after;
  }
}

using Stop = std::function<bool()>;

// A roll that `stop` ends counts as one that slips.
bool slips_on_patches(const Problem& problem, sim::Scenario moved, const Stop& stop) {
  const PatchedFloor& floor = problem.floor;
  if (!floor.has_patches() || std::isinf(floor.reference_friction()) || std::isinf(problem.friction_limit))
    return false;
  const double use = problem.friction_limit / floor.reference_friction();
  moved.surface.static_friction *= use;
  moved.surface.kinetic_friction = std::min(moved.surface.kinetic_friction, moved.surface.static_friction);
  for (sim::SurfacePatch& patch : moved.surface.patches) {
    patch.static_friction *= use;
    patch.kinetic_friction = std::min(patch.kinetic_friction, patch.static_friction);
  }
  moved.run.on_violation = sim::OnViolation::kStop;
  sim::Plant plant(moved);
  constexpr int kParts = 50;
  for (int part = 1; part <= kParts && plant.end() == sim::PhysicsEnd::kNone; ++part) {
    if (stop && stop()) return true;
    plant.advance(part == kParts ? moved.duration_s : moved.duration_s * part / kParts, {});
  }
  return plant.end() != sim::PhysicsEnd::kNone;
}

}  // namespace

PlantRun roll_by_plant(const Problem& problem, const sim::Scenario& scenario, const Grid& grid,
                       const std::vector<double>& knots, const Stop& stop) {
  sim::Scenario moved = with_motion(scenario, grid, knots);
  const bool patched = problem.floor.has_patches();
  PlantRun run;
  run.slips = slips_on_patches(problem, moved, stop);
  moved.surface.hold_everything();
  moved.surface.kinetic_friction = std::numeric_limits<double>::infinity();
  sim::LocalFloor floor(moved.surface);
  Robot robot = problem.robot;
  sim::Plant plant(moved);
  for (int node = 0; node < grid.nodes() && plant.end() == sim::PhysicsEnd::kNone; ++node) {
    if (stop && stop()) return run;
    const bool last = node + 1 == grid.nodes();
    follow(problem.floor, last ? grid.duration_s : node * grid.step_s(), plant, run.need);
    if (plant.end() != sim::PhysicsEnd::kNone) break;
    const sim::Plant::Sample s = plant.sample();
    Node at{};
    at.state.q = {s.orientation[0], s.orientation[1], s.orientation[2], s.orientation[3]};
    at.state.omega_B = sim::vec3(s.angular_velocity_B_radps);
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      at.state.position[i] = s.mass_position[i];
      at.state.velocity[i] = s.mass_velocity[i];
      // Where two pieces meet the acceleration is the same on both sides; at the end it is the motion's last.
      const auto piece = static_cast<std::size_t>(std::min(node / grid.steps_per_piece, grid.pieces - 1));
      const double part = static_cast<double>(node) / grid.steps_per_piece - static_cast<double>(piece);
      const std::size_t n = scenario.masses.size();
      at.state.acceleration[i] = (1 - part) * knots[piece * n + i] + part * knots[(piece + 1) * n + i];
    }
    at.place_m = {s.position_W_m[0], s.position_W_m[1]};
    if (patched) {
      floor.stand_at(s.position_W_m.head<2>());
      robot.ball.rolling_resistance = floor.rolling_resistance();
    }
    evaluate_rolling(robot, at.state, at.value);
    run.nodes.push_back(at);
    run.final = s;
  }
  run.rolled = plant.end() == sim::PhysicsEnd::kNone;
  run.extrema = plant.extrema();
  if (!patched) run.need = run.extrema.mu_required_max.value;
  run.end_s = plant.time_s();
  return run;
}

}  // namespace ballast::plan
