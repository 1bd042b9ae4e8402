#include "tools/plan/quadratic_program.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::plan {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// One side of a row: sign (value + J x) <= bound + level t + s.
struct Side {
  int row;
  double sign, bound, level;
};

// Vectors twice as wide where the processor has them: the same operations on each element, so the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define BALLAST_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define BALLAST_WIDE
#endif

// y += f[0] a + f[1] b + f[2] c + f[3] d
BALLAST_WIDE void add_four(const double* f, const double* __restrict a, const double* __restrict b,
                           const double* __restrict c, const double* __restrict d, double* __restrict y, int n) {
  const double f0 = f[0], f1 = f[1], f2 = f[2], f3 = f[3];
  for (int k = 0; k < n; ++k) y[k] += (f0 * a[k] + f1 * b[k]) + (f2 * c[k] + f3 * d[k]);
}

// Dot product in four sums, which are the lanes of one vector.
BALLAST_WIDE double dot(const double* __restrict a, const double* __restrict b, int n) {
  double sum[4] = {0, 0, 0, 0};
  int k = 0;
  for (; k + 4 <= n; k += 4) {
    for (int lane = 0; lane < 4; ++lane) sum[lane] += a[k + lane] * b[k + lane];
  }
  for (; k < n; ++k) sum[0] += a[k] * b[k];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

BALLAST_WIDE void axpy(double factor, const double* __restrict x, double* __restrict y, int n) {
  for (int k = 0; k < n; ++k) y[k] += factor * x[k];
}

class InteriorPoint {
 public:
  explicit InteriorPoint(const QuadraticProgram& program)
      : program_(program), n_(program.size), size_(n_ + (program.level_weight > 0 ? 1 : 0)) {
    for (std::size_t r = 0; r < program.rows.size(); ++r) {
      const ProgramRow& row = program.rows[r];
      const int k = static_cast<int>(r);
      if (row.level) {
        sides_.push_back({k, 1, 0, 1});
        sides_.push_back({k, -1, 0, 1});
      } else {
        if (std::isfinite(row.upper)) sides_.push_back({k, 1, row.upper, 0});
        if (std::isfinite(row.lower)) sides_.push_back({k, -1, -row.lower, 0});
      }
    }
    const std::size_t count = sides_.size();
    for (auto* v : {&y_, &s_, &lambda_, &dy_, &ds_, &dlambda_, &weight_, &shift_, &rc1_, &rc2_}) v->assign(count, 0);
    for (const ProgramRow& row : program.rows) {
      norm_.push_back(dot(coefficients(row), coefficients(row), row.end - row.begin));
    }
    least_diagonal_ = std::numeric_limits<double>::infinity();
    for (int i = 0; i < n_; ++i) {
      least_diagonal_ = std::min(least_diagonal_, program.hessian[index(i) * index(n_) + index(i)]);
    }
    x_.assign(index(n_ + 1), 0);
    dx_.assign(index(n_ + 1), 0);
    jx_.assign(program.rows.size(), 0);
  }

  ProgramSolution run() {
    start();
    const double objective_at_0 = elastic_objective();
    ProgramSolution out;
    for (; out.iterations < kMostIterations; ++out.iterations) {
      set_residual();
      const double gap = mean_gap();
      if (2 * gap * static_cast<double>(sides_.size()) < kGap * scale_ && residual_ < kResidual * scale_) break;
      if (!iterate(gap)) break;
    }
    out.decrease = objective_at_0 - elastic_objective();
    out.x.assign(x_.begin(), x_.begin() + n_);
    out.level = x_[index(n_)];
    out.pressure.assign(program_.rows.size(), 0);
    for (std::size_t i = 0; i < sides_.size(); ++i) out.pressure[index(sides_[i].row)] += sides_[i].sign * lambda_[i];
    if (out.iterations > 0) out.factor = std::move(matrix_);
    if (!(out.decrease > 0) || !std::isfinite(out.decrease)) {
      std::fill(out.x.begin(), out.x.end(), 0.0);
      out.decrease = 0;
    }
    return out;
  }

 private:
  static constexpr int kMostIterations = 30;
  static constexpr double kGap = 2e-4, kResidual = 1e-5;  // of the weights: the step is checked on the true problem
  static constexpr double kNegligible = 1e-5;
  static constexpr double kStepBack = 0.995;

  const double* coefficients(const ProgramRow& row) const { return &program_.coefficients[row.offset]; }
  [[nodiscard]] bool has_level() const { return size_ > n_; }

  void start() {
    scale_ = std::max(program_.level_weight, program_.penalty * 1e-2);
    double level = 0;
    for (const ProgramRow& row : program_.rows) {
      if (row.level) level = std::max(level, std::abs(row.value));
    }
    x_[index(n_)] = has_level() ? 1.05 * level + 1e-3 : 0;
    // The level's multipliers sum to its weight.
    std::size_t levels = 0;
    for (const Side& side : sides_) levels += side.level > 0 ? 1 : 0;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Side& side = sides_[i];
      const double over = side.sign * program_.rows[index(side.row)].value - side.bound - side.level * x_[index(n_)];
      constexpr double kRoom = 0.1;
      s_[i] = std::max(over, 0.0) + kRoom;
      y_[i] = s_[i] - over;
      const double most = 0.5 * program_.penalty;
      lambda_[i] = side.level > 0 ? std::min(most, program_.level_weight / static_cast<double>(levels))
                                  : std::min(most, 0.1 * scale_ * kRoom / y_[i]);
    }
  }

  // Objective at x with the best t and s.
  double elastic_objective() {
    multiply(x_);
    double level = 0, sum = 0;
    for (std::size_t r = 0; r < program_.rows.size(); ++r) {
      const ProgramRow& row = program_.rows[r];
      const double v = row.value + jx_[r];
      if (row.level) {
        level = std::max(level, std::abs(v));
      } else {
        sum += std::max({0.0, v - row.upper, row.lower - v});
      }
    }
    double quadratic = 0;
    for (int i = 0; i < n_; ++i) {
      const double* h = &program_.hessian[index(i) * index(n_)];
      quadratic += x_[index(i)] * (dot(h, x_.data(), i) + 0.5 * h[i] * x_[index(i)] + program_.gradient[index(i)]);
    }
    return quadratic + program_.level_weight * level + program_.penalty * sum;
  }

  void multiply(const std::vector<double>& x) {
    for (std::size_t r = 0; r < program_.rows.size(); ++r) {
      const ProgramRow& row = program_.rows[r];
      jx_[r] = dot(coefficients(row), &x[index(row.begin)], row.end - row.begin);
    }
  }

  // Residuals of the conditions: stationarity in rx_, primal in shift_ (reused later).
  void set_residual() {
    multiply(x_);
    rx_.assign(index(n_ + 1), 0);
    for (int i = 0; i < n_; ++i) {
      const double* h = &program_.hessian[index(i) * index(n_)];
      rx_[index(i)] += program_.gradient[index(i)] + dot(h, x_.data(), i + 1);
      axpy(x_[index(i)], h, rx_.data(), i);
    }
    rx_[index(n_)] = program_.level_weight;
    std::vector<double> along(program_.rows.size(), 0);
    rp_.resize(sides_.size());
    residual_ = 0;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Side& side = sides_[i];
      const std::size_t r = index(side.row);
      along[r] += side.sign * lambda_[i];
      rx_[index(n_)] -= side.level * lambda_[i];
      rp_[i] = side.bound + side.level * x_[index(n_)] + s_[i] - side.sign * (program_.rows[r].value + jx_[r]) - y_[i];
      residual_ = std::max(residual_, std::abs(rp_[i]) * scale_);
    }
    for (std::size_t r = 0; r < along.size(); ++r) {
      const ProgramRow& row = program_.rows[r];
      if (along[r] != 0) axpy(along[r], coefficients(row), &rx_[index(row.begin)], row.end - row.begin);
    }
    if (!has_level()) rx_[index(n_)] = 0;
    for (const double r : rx_) residual_ = std::max(residual_, std::abs(r));
  }

  [[nodiscard]] double mean_gap() const {
    double sum = 0;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      sum += lambda_[i] * y_[i] + (program_.penalty - lambda_[i]) * s_[i];
    }
    return sides_.empty() ? 0 : sum / static_cast<double>(2 * sides_.size());
  }

  bool form_matrix() {
    matrix_.assign(index(size_) * index(size_), 0);
    for (int i = 0; i < n_; ++i) {
      std::copy_n(&program_.hessian[index(i) * index(n_)], i + 1, &matrix_[index(i) * index(size_)]);
    }
    std::vector<double> sum(program_.rows.size(), 0), coupling(program_.rows.size(), 0);
    double level = 1e-9 * scale_;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Side& side = sides_[i];
      weight_[i] = 1 / (y_[i] / lambda_[i] + s_[i] / (program_.penalty - lambda_[i]));
      sum[index(side.row)] += weight_[i];
      coupling[index(side.row)] -= weight_[i] * side.sign * side.level;
      level += weight_[i] * side.level * side.level;
    }
    double* level_row = &matrix_[index(size_ - 1) * index(size_)];
    std::vector<int> heavy;
    for (std::size_t r = 0; r < program_.rows.size(); ++r) {
      const ProgramRow& row = program_.rows[r];
      const double* j = coefficients(row);
      if (has_level() && coupling[r] != 0) axpy(coupling[r], j, level_row + row.begin, row.end - row.begin);
      // A row far from its limits changes nothing. It is still in the residuals, so that the solution stays the same.
      if (sum[r] * norm_[r] < kNegligible * least_diagonal_) continue;
      heavy.push_back(static_cast<int>(r));
    }
    // Four rows at a time where they begin alike, as nearly all do: the matrix is then read and written a quarter as
    // often.
    std::size_t k = 0;
    for (; k + 4 <= heavy.size(); k += 4) {
      const ProgramRow* rows[4];
      for (std::size_t c = 0; c < 4; ++c) rows[c] = &program_.rows[index(heavy[k + c])];
      const bool alike =
          std::all_of(rows, rows + 4, [&](const ProgramRow* row) { return row->whole && row->begin == 0; });
      if (!alike) {
        for (std::size_t c = 0; c < 4; ++c) add_row(heavy[k + c], sum);
        continue;
      }
      int end = 0;
      for (const ProgramRow* row : rows) end = std::max(end, row->end);
      const double *a = coefficients(*rows[0]), *b = coefficients(*rows[1]), *c = coefficients(*rows[2]),
                   *d = coefficients(*rows[3]);
      for (int i = 0; i < end; ++i) {
        const double factor[4] = {sum[index(heavy[k])] * a[i], sum[index(heavy[k + 1])] * b[i],
                                  sum[index(heavy[k + 2])] * c[i], sum[index(heavy[k + 3])] * d[i]};
        add_four(factor, a, b, c, d, &matrix_[index(i) * index(size_)], i + 1);
      }
    }
    for (; k < heavy.size(); ++k) add_row(heavy[k], sum);
    if (has_level()) level_row[n_] = level;
    return factorise(matrix_, size_);
  }

  void add_row(int r, const std::vector<double>& weight) {
    const ProgramRow& row = program_.rows[index(r)];
    const double* j = coefficients(row);
    for (int i = row.begin; i < row.end; ++i) {
      const double factor = weight[index(r)] * j[i - row.begin];
      if (factor == 0) continue;
      axpy(factor, j, &matrix_[index(i) * index(size_) + index(row.begin)], i - row.begin + 1);
    }
  }

  // Direction for the complementarity targets rc1_, rc2_.
  void direction() {
    std::vector<double> right(index(size_), 0);
    for (int i = 0; i < size_; ++i) right[index(i)] = -rx_[index(i)];
    std::vector<double> along(program_.rows.size(), 0);
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      shift_[i] = rc1_[i] / lambda_[i] - rc2_[i] / (program_.penalty - lambda_[i]) - rp_[i];
      const double force = weight_[i] * shift_[i];
      along[index(sides_[i].row)] += sides_[i].sign * force;
      if (has_level()) right[index(n_)] += sides_[i].level * force;
    }
    for (std::size_t r = 0; r < along.size(); ++r) {
      const ProgramRow& row = program_.rows[r];
      if (along[r] != 0) axpy(-along[r], coefficients(row), &right[index(row.begin)], row.end - row.begin);
    }
    solve_factorised(matrix_, size_, right);
    std::fill(dx_.begin(), dx_.end(), 0.0);
    std::copy(right.begin(), right.end(), dx_.begin());
    multiply(dx_);
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const Side& side = sides_[i];
      const double change = side.sign * jx_[index(side.row)] - side.level * dx_[index(n_)];
      dlambda_[i] = weight_[i] * (change + shift_[i]);
      ds_[i] = (rc2_[i] + s_[i] * dlambda_[i]) / (program_.penalty - lambda_[i]);
      dy_[i] = (rc1_[i] - y_[i] * dlambda_[i]) / lambda_[i];
    }
  }

  [[nodiscard]] double longest_step() const {
    double longest = 1;
    const auto limit = [&](double value, double change) {
      if (change < 0) longest = std::min(longest, -value / change);
    };
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      limit(y_[i], dy_[i]);
      limit(s_[i], ds_[i]);
      limit(lambda_[i], dlambda_[i]);
      limit(program_.penalty - lambda_[i], -dlambda_[i]);
    }
    return longest;
  }

  bool iterate(double gap) {
    if (!form_matrix()) return false;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      rc1_[i] = -lambda_[i] * y_[i];
      rc2_[i] = -(program_.penalty - lambda_[i]) * s_[i];
    }
    direction();
    const double affine = longest_step();
    double ahead = 0;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const double lambda = lambda_[i] + affine * dlambda_[i];
      ahead += lambda * (y_[i] + affine * dy_[i]) + (program_.penalty - lambda) * (s_[i] + affine * ds_[i]);
    }
    ahead /= static_cast<double>(std::max<std::size_t>(1, 2 * sides_.size()));
    // The corrector assumes a full affine step, so a short one makes it count less.
    const double target = gap > 0 ? gap * std::pow(std::clamp(ahead / gap, 0.0, 1.0), 3) : 0;
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      const double product = affine * affine * dlambda_[i];
      rc1_[i] += target - product * dy_[i];
      rc2_[i] += target + product * ds_[i];
    }
    direction();
    double length = sides_.empty() ? 1 : std::min(1.0, kStepBack * longest_step());
    constexpr double kShort = 0.1;
    if (length < kShort) {
      // Towards the middle instead, without a corrector.
      for (std::size_t i = 0; i < sides_.size(); ++i) {
        rc1_[i] = 0.5 * gap - lambda_[i] * y_[i];
        rc2_[i] = 0.5 * gap - (program_.penalty - lambda_[i]) * s_[i];
      }
      direction();
      length = std::min(1.0, kStepBack * longest_step());
    }
    if (!std::isfinite(length)) return false;
    for (std::size_t i = 0; i < x_.size(); ++i) x_[i] += length * dx_[i];
    for (std::size_t i = 0; i < sides_.size(); ++i) {
      y_[i] += length * dy_[i];
      s_[i] += length * ds_[i];
      lambda_[i] += length * dlambda_[i];
    }
    return true;
  }

  const QuadraticProgram& program_;
  int n_, size_;
  double scale_ = 1, residual_ = 0, least_diagonal_ = 0;
  std::vector<Side> sides_;
  std::vector<double> x_, dx_, y_, s_, lambda_, dy_, ds_, dlambda_, weight_, shift_, rc1_, rc2_, rp_, rx_, jx_, norm_,
      matrix_;
};

}  // namespace

bool factorise(std::vector<double>& a, int size) {
  for (int i = 0; i < size; ++i) {
    double* row = &a[index(i) * index(size)];
    for (int j = 0; j < i; ++j) {
      const double* other = &a[index(j) * index(size)];
      row[j] = (row[j] - dot(row, other, j)) / other[j];
    }
    const double left = row[i] - dot(row, row, i);
    if (!(left > 0)) return false;
    row[i] = std::sqrt(left);
  }
  return true;
}

void solve_factorised(const std::vector<double>& factor, int size, std::vector<double>& b) {
  for (int i = 0; i < size; ++i) {
    const double* row = &factor[index(i) * index(size)];
    b[index(i)] = (b[index(i)] - dot(row, b.data(), i)) / row[i];
  }
  for (int i = size - 1; i >= 0; --i) {
    const double* row = &factor[index(i) * index(size)];
    b[index(i)] /= row[i];
    axpy(-b[index(i)], row, b.data(), i);
  }
}

ProgramSolution solve(const QuadraticProgram& program) { return InteriorPoint(program).run(); }

}  // namespace ballast::plan
