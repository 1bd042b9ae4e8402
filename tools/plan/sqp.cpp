#include "tools/plan/sqp.h"

#include <algorithm>
#include <cmath>

#include "tools/plan/quadratic_program.h"

namespace ballast::plan {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

constexpr double kFirstWeight = 300, kLastWeight = 3e4;  // of half a squared equality
constexpr double kPenalty = 30;                          // of a limit's violation; a level's whole weight is 1
// Weights on half the mean squared acceleration: enough to choose among motions of the same need. Motors swing with
// every change of the acceleration, so theirs is worth more.
constexpr double kRegularisation = 1e-4, kDrivenRegularisation = 0.01;

class Sqp {
 public:
  Sqp(Rollout& rollout, Transcription& transcription, const std::vector<bool>& fixed, const SqpSettings& settings,
      std::vector<double>& knots, Effort& effort)
      : rollout_(rollout),
        transcription_(transcription),
        problem_(transcription.problem()),
        fixed_(fixed),
        settings_(settings),
        knots_(knots),
        effort_(effort),
        size_(rollout.variables()) {
    for (int v = 0; v < size_; ++v) unit_.push_back(acceleration_unit(problem_, v % problem_.masses()));
    for (int i = 0; i < problem_.masses(); ++i) driven_ = driven_ || problem_.limits[index(i)].motor;
    short_steps_ = settings.short_steps;
    by_level_ = settings.objective != Objective::kEffort;
  }

  Merit run() {
    bool good = rollout_.roll(knots_);
    if (good) rollout_.differentiate();
    Merit now = judge(transcription_, knots_);
    double damping = kFirstDamping;
    int quiet = 0, slow_steps = 0;
    std::vector<double> merits;  // before the last steps
    for (int k = 0; good && k < settings_.most_iterations; ++k) {
      if (effort_.stop && effort_.stop()) break;
      ++effort_.iterations;
      if (effort_.progress) effort_.progress(now.need, now.error());
      const double weight_before = weight_;
      weight_ = now.equality > 0.1 ? kFirstWeight : now.equality > 0.01 ? 10 * kFirstWeight : tightened_ * kLastWeight;
      if (weight_ != weight_before) merits.clear();  // they cannot be compared
      const double merit = true_merit();
      build();
      bool accepted = false;
      double gained = 0;
      for (int attempt = 0; attempt < 9 && !accepted; ++attempt) {
        for (int v = 0; v < size_; ++v) program_.hessian[index(v) * index(size_) + index(v)] += damping;
        const ProgramSolution step = solve(program_);
        const std::vector<double> before = knots_;
        for (int v = 0; v < size_; ++v) knots_[index(v)] += unit_[index(v)] * step.x[index(v)];
        gained = take(step, merit);
        accepted = gained > kLeastGain * step.decrease;
        if (accepted) {
          if (gained > 0.7 * step.decrease && attempt == 0) damping = std::max(damping / 3, 1e-7);
          if (gained < 0.3 * step.decrease) damping *= 2;
        } else {
          knots_ = before;
          const bool far_off = gained < -10 * step.decrease;  // the linear model means nothing there
          damping = std::min(damping * (far_off ? 25 : 5), 1e8);
        }
      }
      if (!accepted) {
        good = rollout_.roll(knots_);
        if (!good || !tighten(now)) break;
        damping = kFirstDamping;
        slow_steps = 0;
        continue;
      }
      rollout_.differentiate();
      transcription_.move_via_times();
      const Merit then = judge(transcription_, knots_);
      const double size = std::max(then.need, 1e-6);
      const double most_equality = tightened_ > 1 ? kMetWhenTightened : settings_.most_equality;
      const bool holds = then.equality < most_equality && then.limit < settings_.most_limit;
      const bool slow = by_level_ ? now.need - then.need < settings_.tolerance * size
                                  : now.effort - then.effort < settings_.tolerance * then.effort;
      now = then;
      merits.push_back(merit);
      if (settings_.gives_up && crawls(merits) && now.equality > kNearlyMet) break;
      slow_steps = gained < kSlow * merit ? slow_steps + 1 : 0;
      if (slow_steps >= 3 && tighten(now)) slow_steps = 0;
      quiet = holds && slow ? quiet + 1 : 0;
      if (quiet >= 2 || (holds && then.need <= settings_.good_enough)) break;
    }
    const bool ended = effort_.ended && effort_.ended();
    if (good && !ended && now.equality > kMet && now.equality < kNearlyMet) now = meet_equalities(now);
    return now;
  }

 private:
  static constexpr double kMet = 1e-6, kNearlyMet = 1e-2;
  static constexpr double kMetWhenTightened = 1e-4;  // a third of what counts as rest (search.cpp)
  static constexpr double kMostTightened = 100;
  static constexpr double kFirstDamping = 1e-3;
  static constexpr double kSlow = 2e-3;       // gain over the merit below which a step is slow
  static constexpr double kLeastGain = 0.05;  // of what the program promises
  static constexpr double kFar = 0.4;         // of a limit: a value below is far away from it

  // The merit has fallen by little in the last steps.
  static bool crawls(const std::vector<double>& merits) {
    constexpr std::size_t kSteps = 6;
    return merits.size() > kSteps && merits.back() > 0.7 * merits[merits.size() - 1 - kSteps];
  }

  // Makes the equalities ten times as heavy, and counts steps without their correction from then on. For a merit that
  // has come to its end with equalities unmet, by about their multiplier over their weight. That happens where a floor
  // resists: a ball below the creep rate forgets in a fraction of a piece how it came there, so its rates at the end
  // are steep and bent functions of the knots, and the correction is longer than the step that it corrects. False: the
  // equalities are met, or too far from it, or as heavy as they get, or the floor does not resist.
  bool tighten(const Merit& now) {
    if (!resists(problem_)) return false;
    if (tightened_ >= kMostTightened || now.equality < settings_.most_equality || now.equality > kNearlyMet)
      return false;
    tightened_ *= 10;
    short_steps_ = true;
    return true;
  }

  // Takes a step, and returns what the merit gains by it. The correction of the equalities is for long steps; where a
  // short one is needed, between limits, it may undo it. With short_steps_ the step alone counts then; without,
  // the search would crawl along limits where another start is better.
  double take(const ProgramSolution& step, double merit) {
    if (!(step.decrease > 0) || !rollout_.roll(knots_)) return -1;
    if (!short_steps_) return restore(step.factor) ? merit - true_merit() : -1;
    const double gained_alone = merit - true_merit();
    const std::vector<double> alone = knots_;
    if (restore(step.factor)) {
      const double gained = merit - true_merit();
      if (gained > kLeastGain * step.decrease || gained >= gained_alone) return gained;
    }
    knots_ = alone;
    return rollout_.roll(knots_) ? gained_alone : -1;
  }

  // Where the merit has come to its end a little beside the equalities: meets them, if the limits allow it.
  Merit meet_equalities(const Merit& reached) {
    const std::vector<double> before = knots_;
    Merit now = reached;
    for (int round = 0; round < 4 && now.equality > kMet; ++round) {
      build();
      if (!restore({})) break;
      rollout_.differentiate();
      now = judge(transcription_, knots_);
    }
    if (now.equality < reached.equality && now.limit < reached.limit + 1e-3) return now;
    knots_ = before;
    static_cast<void>(rollout_.roll(knots_));
    rollout_.differentiate();
    return reached;
  }

  // Penalised by how far it is out of [lower, upper].
  static double outside(const Limit& limit) {
    return std::max({0.0, limit.value - limit.upper, limit.lower - limit.value});
  }

  [[nodiscard]] double friction_bound() const {
    return by_level_ ? std::numeric_limits<double>::infinity()
                     : 0.998 * settings_.friction_limit / transcription_.friction_unit;
  }

  double true_merit() const {
    double sum = 0, level = 0;
    for (const double ratio : transcription_.ratios()) {
      level = std::max(level, ratio);
      sum += std::max(0.0, ratio - friction_bound());
    }
    transcription_.limits(false, [&](const Limit& limit, const NodeForm&) { sum += outside(limit); });
    knot_limits([&](const Limit& limit, int, int, double) { sum += outside(limit); });
    double merit = kPenalty * sum + (by_level_ ? level : 0);
    transcription_.soft_terms([&](double residual, const NodeForm&) { merit += 0.5 * residual * residual; });
    const auto equalities = transcription_.equalities(false);
    for (const auto& e : equalities) merit += 0.5 * weight_ * e.value * e.value;
    for (int v = 0; v < size_; ++v) {
      const double x = knots_[index(v)] / unit_[index(v)];
      merit += 0.5 * effort_weight() * x * x;
    }
    return merit;
  }

  [[nodiscard]] double effort_weight() const {
    const double smooth = driven_ ? kDrivenRegularisation : kRegularisation;
    return (by_level_ ? smooth : 1.0) / rollout_.grid().knots();
  }

  // Accelerations and jerks: sink(limit, variable, other variable or -1, derivative by the first).
  template <class Sink>
  void knot_limits(Sink sink) const {
    const int n = problem_.masses();
    for (int v = 0; v < size_; ++v) {
      const MassLimits& limits = problem_.limits[index(v % n)];
      if (std::isfinite(limits.acceleration)) {
        constexpr double kRoom = 1e-4;
        sink(Limit{LimitKind::kAcceleration, v % n, v / n, knots_[index(v)] / limits.acceleration, -1 + kRoom,
                   1 - kRoom},
             v, -1, unit_[index(v)] / limits.acceleration);
      }
      if (std::isfinite(limits.jerk) && v + n < size_) {
        const double most = limits.jerk * rollout_.grid().piece_s();
        constexpr double kRoom = 1e-4;
        sink(Limit{LimitKind::kJerk, v % n, v / n, (knots_[index(v + n)] - knots_[index(v)]) / most, -1 + kRoom,
                   1 - kRoom},
             v + n, v, unit_[index(v)] / most);
      }
    }
  }

  // A row of zeros in the program.
  double* new_row(ProgramRow& row) {
    row.offset = program_.coefficients.size();
    program_.coefficients.resize(row.offset + index(size_), 0.0);
    return &program_.coefficients[row.offset];
  }

  // Scales a row to the program's variables and adds it.
  void add_row(ProgramRow row) {
    double* j = &program_.coefficients[row.offset];
    for (int v = 0; v < row.end; ++v) j[v] = fixed_[index(v)] ? 0 : j[v] * unit_[index(v)];
    row.whole = true;
    program_.rows.push_back(row);
  }

  void build() {
    program_.size = size_;
    program_.rows.clear();
    program_.coefficients.clear();
    program_.level_weight = by_level_ ? 1 : 0;
    program_.penalty = kPenalty;
    program_.gradient.assign(index(size_), 0);
    program_.hessian.assign(index(size_) * index(size_), 0);
    for (int v = 0; v < size_; ++v) {
      program_.hessian[index(v) * index(size_) + index(v)] = effort_weight();
      program_.gradient[index(v)] = fixed_[index(v)] ? 0 : effort_weight() * knots_[index(v)] / unit_[index(v)];
    }
    add_equalities();
    add_soft_terms();
    add_ratios();
    add_limits();
  }

  // Second-order correction: the change that takes what the step has left of the equalities away, by the derivatives of
  // the point before, and disturbs limits and level least. Without it a heavy weight on curved equalities would allow
  // tiny steps only. Without a factor, the change of the knots is
  // the smallest. Kept if the equalities become smaller. False if the motion does not stay finite.
  bool restore(const std::vector<double>& factor) {
    const auto size_of = [this] {
      double sum = 0;
      for (const auto& e : transcription_.equalities(false)) sum += e.value * e.value;
      return sum;
    };
    const std::size_t m = equality_rows_.size();
    if (m == 0) return true;
    const int whole = size_ + (by_level_ ? 1 : 0);
    std::vector<std::vector<double>> soft = equality_rows_;
    for (auto& direction : soft) {
      if (factor.empty()) continue;
      direction.resize(index(whole), 0.0);
      solve_factorised(factor, whole, direction);
    }
    double left = size_of();
    for (int round = 0; round < 2 && left > 1e-14; ++round) {
      std::vector<double> gram(m * m), pull(m);
      const auto equalities = transcription_.equalities(false);
      double greatest = 0;
      for (std::size_t a = 0; a < m; ++a) {
        pull[a] = -equalities[a].value;
        for (std::size_t b = 0; b <= a; ++b) {
          for (std::size_t v = 0; v < index(size_); ++v) gram[a * m + b] += equality_rows_[a][v] * soft[b][v];
        }
        greatest = std::max(greatest, gram[a * m + a]);
      }
      for (std::size_t a = 0; a < m; ++a) gram[a * m + a] += 1e-9 * greatest;
      if (!factorise(gram, static_cast<int>(m))) return true;
      solve_factorised(gram, static_cast<int>(m), pull);
      const std::vector<double> before = knots_;
      for (std::size_t a = 0; a < m; ++a) {
        for (std::size_t v = 0; v < index(size_); ++v) {
          if (!fixed_[v]) knots_[v] += unit_[v] * soft[a][v] * pull[a];
        }
      }
      const double now = rollout_.roll(knots_) ? size_of() : left;
      if (!(now < left)) {
        knots_ = before;
        return rollout_.roll(knots_);
      }
      left = now;
    }
    return true;
  }

  void add_equalities() {
    const auto equalities = transcription_.equalities(true);
    equality_rows_.assign(equalities.size(), std::vector<double>(index(size_), 0.0));
    for (std::size_t k = 0; k < equalities.size(); ++k) {
      const auto& e = equalities[k];
      std::vector<double>& j = equality_rows_[k];
      int end = 0;
      for (int f = 0; f < e.forms; ++f) end = std::max(end, transcription_.expand(e.form[index(f)], 1, j.data()));
      for (int v = 0; v < end; ++v) j[index(v)] = fixed_[index(v)] ? 0 : j[index(v)] * unit_[index(v)];
      const double pull = weight_ * e.value;
      for (int v = 0; v < end; ++v) {
        program_.gradient[index(v)] += pull * j[index(v)];
        const double factor = weight_ * j[index(v)];
        double* row = &program_.hessian[index(v) * index(size_)];
        for (int w = 0; w <= v; ++w) row[w] += factor * j[index(w)];
      }
    }
  }

  void add_soft_terms() {
    std::vector<double> j(index(size_));
    transcription_.soft_terms([&](double residual, const NodeForm& form) {
      std::fill(j.begin(), j.end(), 0.0);
      const int end = transcription_.expand(form, 1, j.data());
      for (int v = 0; v < end; ++v) j[index(v)] = fixed_[index(v)] ? 0 : j[index(v)] * unit_[index(v)];
      for (int v = 0; v < end; ++v) {
        program_.gradient[index(v)] += residual * j[index(v)];
        double* row = &program_.hessian[index(v) * index(size_)];
        for (int w = 0; w <= v; ++w) row[w] += j[index(v)] * j[index(w)];
      }
    });
  }

  // Each node's f / N has a row along its direction. Every second one has a row across it too, since the
  // direction may turn in the step.
  void add_ratios() {
    for (int node = 0; node < rollout_.grid().nodes(); ++node) {
      std::array<double, 2> q{};
      std::array<NodeForm, 2> form{};
      transcription_.ratio_forms(node, q, form);
      const double size = std::hypot(q[0], q[1]);
      if (!by_level_ && size < kFar * friction_bound()) continue;
      const double along[2] = {size > 0 ? q[0] / size : 1, size > 0 ? q[1] / size : 0};
      const double across[2] = {-along[1], along[0]};
      for (const double* direction : {along, across}) {
        if (direction == across && node % 2 == 1) continue;
        ProgramRow row;
        double* j = new_row(row);
        for (std::size_t c = 0; c < 2; ++c) {
          row.value += direction[c] * q[c];
          row.end = transcription_.expand(form[c], direction[c], j);
        }
        row.level = by_level_;
        row.upper = friction_bound();
        row.lower = -row.upper;
        if (!row.level && !std::isfinite(row.upper)) {
          program_.coefficients.resize(row.offset);
          continue;
        }
        add_row(row);
      }
    }
  }

  void add_limits() {
    transcription_.limits(true, [&](const Limit& limit, const NodeForm& form) {
      if (far(limit)) return;
      ProgramRow row;
      row.end = transcription_.expand(form, 1, new_row(row));
      row.value = limit.value;
      row.lower = limit.lower;
      row.upper = limit.upper;
      add_row(row);
    });
    knot_limits([&](const Limit& limit, int variable, int other, double slope) {
      if (far(limit)) return;
      ProgramRow row;
      row.begin = std::min(variable, other < 0 ? variable : other);
      row.end = std::max(variable, other) + 1;
      row.value = limit.value;
      row.lower = limit.lower;
      row.upper = limit.upper;
      row.offset = program_.coefficients.size();
      program_.coefficients.resize(row.offset + index(row.end - row.begin), 0.0);
      double* j = &program_.coefficients[row.offset];
      if (!fixed_[index(variable)]) j[variable - row.begin] = slope;
      if (other >= 0 && !fixed_[index(other)]) j[other - row.begin] = -slope;
      program_.rows.push_back(row);
    });
  }

  // A limit so far away that no step reaches it: steps are damped, and checked on the true merit.
  static bool far(const Limit& limit) {
    if (limit.kind == LimitKind::kKeepOut) return limit.value > limit.lower + 2;
    if (limit.kind == LimitKind::kNormalForce) return limit.value > 0.7;
    if (limit.kind == LimitKind::kStability || limit.kind == LimitKind::kRailEnd) return false;
    if (limit.kind == LimitKind::kFollow) return false;  // a step may well cross the whole band
    return limit.value > kFar * limit.lower && limit.value < kFar * limit.upper;
  }

  Rollout& rollout_;
  Transcription& transcription_;
  const Problem& problem_;
  const std::vector<bool>& fixed_;
  const SqpSettings& settings_;
  std::vector<double>& knots_;
  Effort& effort_;
  int size_;
  bool by_level_ = true, driven_ = false, short_steps_ = false;
  double tightened_ = 1;  // factor on the last weight of the equalities
  double weight_ = kFirstWeight;
  std::vector<double> unit_;
  std::vector<std::vector<double>> equality_rows_;  // by the program's variables
  QuadraticProgram program_;
};

}  // namespace

double acceleration_unit(const Problem& problem, int mass) {
  const double time = time_unit_s(problem);
  return 0.05 * problem.robot.ball.radius_m / (time * time) / problem.metres_per_unit[mass];
}

Merit judge(const Transcription& transcription, const std::vector<double>& knots,
            const std::function<double(LimitKind)>& tolerance) {
  const Problem& problem = transcription.problem();
  Merit merit;
  for (const double ratio : transcription.ratios())
    merit.need = std::max(merit.need, ratio * transcription.friction_unit);
  const int n = problem.masses();
  for (std::size_t v = 0; v < knots.size(); ++v) {
    const double x = knots[v] / acceleration_unit(problem, static_cast<int>(v) % n);
    merit.effort += x * x / static_cast<double>(knots.size());
  }
  const auto note = [&](const Limit& limit) {
    const double allowed = tolerance ? tolerance(limit.kind) : 0;
    const double over = std::max(limit.value - limit.upper, limit.lower - limit.value) - allowed;
    if (over <= merit.limit) return;
    merit.limit = over;
    merit.worst_limit = limit;
  };
  transcription.limits(false, [&](const Limit& limit, const NodeForm&) { note(limit); });
  const double piece_s = transcription.rollout().grid().piece_s();
  for (std::size_t v = 0; v < knots.size(); ++v) {
    const int mass = static_cast<int>(v) % n, knot = static_cast<int>(v) / n;
    const MassLimits& limits = problem.limits[index(mass)];
    if (std::isfinite(limits.acceleration)) {
      note({LimitKind::kAcceleration, mass, knot, knots[v] / limits.acceleration, -1, 1});
    }
    if (std::isfinite(limits.jerk) && v + index(n) < knots.size()) {
      note({LimitKind::kJerk, mass, knot, (knots[v + index(n)] - knots[v]) / piece_s / limits.jerk, -1, 1});
    }
  }
  for (const auto& e : transcription.equalities(false)) {
    if (std::abs(e.value) <= merit.equality) continue;
    merit.equality = std::abs(e.value);
    merit.worst_equality = e.kind;
  }
  return merit;
}

Merit improve(Rollout& rollout, Transcription& transcription, const std::vector<bool>& fixed,
              const SqpSettings& settings, std::vector<double>& knots, Effort& effort) {
  return Sqp(rollout, transcription, fixed, settings, knots, effort).run();
}

}  // namespace ballast::plan
