// The sequence of contact regimes: how a run starts, what follows a regime that has ended, impacts, and the end of the
// physics. physics.md section 4.
//
// Choices that section 4 leaves open:
//   - In an impact prescribed masses keep their rail velocity. Driven masses yield along their rails with their rotors,
//     because the motors' forces are finite.
//   - An impact slower than 1e-6 sqrt(g r) leaves no normal velocity: bouncing ends.
#pragma once

#include <string>
#include <vector>

#include "sim/plant/progress.h"

namespace ballast::sim {

// A stretch of one regime. It ends where the next one starts, or where the run ends. Flight continues through impacts
// that throw the ball up again.
struct RegimeStart {
  Regime regime;
  double time_s;
};

struct ImpactRecord {
  double time_s;
  double normal_impulse_ns;
  double friction_impulse_ns;  // its magnitude
  bool sticking;
};

enum class PhysicsEnd {
  kNone,          // the run continues
  kSlipped,       // f_s > mu_s N, and the run was to stop there
  kDetached,      // N <= 0, and the run was to stop there
  kInconsistent,  // the state is not finite or cannot be continued
};

class Regimes {
 public:
  explicit Regimes(const PlantModel& model)
      : on_violation_(model.on_violation), restitution_(model.surface.restitution) {}

  [[nodiscard]] PhysicsEnd end() const { return end_; }
  [[nodiscard]] const std::string& end_text() const { return end_text_; }           // why it is inconsistent
  [[nodiscard]] const std::vector<RegimeStart>& starts() const { return starts_; }  // neighbours differ
  [[nodiscard]] const std::vector<ImpactRecord>& impacts() const { return impacts_; }
  [[nodiscard]] bool rolling_lost() const { return rolling_lost_; }

  // Puts the ball where `initial` says, rolling, sliding or in the air, with the motors balanced in that regime.
  void start(const InitialState& initial, Progress& run);
  // Evaluates an instant at which something may have jumped, and leaves the regime if it is over.
  void continue_after_jump(Progress& run);
  // The regime is over now: finds what follows.
  void leave(Progress& run);
  void end_inconsistent(std::string text, Progress& run);
  // Sliding has come to where it has no solution.
  void end_painleve(Progress& run);

 private:
  void enter(Regime regime, Progress& run);
  void land(Progress& run);
  // Continues a contact that neither leaves nor arrives, with this slip.
  void touch(const Eigen::Vector2d& slip_W_mps, Progress& run);
  [[nodiscard]] static bool can_roll(Progress& run, Instant& rolling);
  // The regime changes too often at one instant.
  [[nodiscard]] bool changes_without_end(double time_s);

  OnViolation on_violation_;
  double restitution_;
  std::vector<RegimeStart> starts_;
  std::vector<ImpactRecord> impacts_;
  bool rolling_lost_ = false;
  double last_change_s_ = -1;
  int changes_here_ = 0;
  PhysicsEnd end_ = PhysicsEnd::kNone;
  std::string end_text_;
};

}  // namespace ballast::sim
