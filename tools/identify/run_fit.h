// One recording in the fit: what its samples say of the parameters, once everything that is the run's own has been
// eliminated.
//
// Residuals are means of the IMU's samples over windows (rollout.h), less those of the rolled model read by an IMU with
// errors. The run's own unknowns are
//   scale errors and misalignments of gyro and accelerometer (12),
//   of each mass on a stepper how far it stands from its command, and how much of the computed lag it has (2 n),
//   their biases at knots a few seconds apart, linear in between (6 each),
//   attitude, rate and place at the start of each segment (8 each).
// The sensors' data give a prior of the first two, the walk of the bias included; the mean over the hold before
// tick 0 is one more sample. Segments are free of each other (multiple shooting).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <utility>
#include <vector>

#include "tools/identify/parameters.h"
#include "tools/identify/rollout.h"

namespace ballast::identify {

// Normal equations of the parameters, without the run's own unknowns, and what those become.
struct Reduced {
  Eigen::MatrixXd information;  // A = H_pp - B H_lp, B = H_pl H_ll^-1
  Eigen::VectorXd pull;         // the step is A^-1 pull
};

class RunFit {
 public:
  RunFit(Recording recording, const Parameters& parameters);

  [[nodiscard]] const Recording& recording() const { return recording_; }
  [[nodiscard]] int windows() const { return timeline_.windows(); }
  [[nodiscard]] double window_s() const { return timeline_.window_s(); }
  [[nodiscard]] bool whole() const { return segments_.size() == 1; }
  [[nodiscard]] std::size_t segments() const { return segments_.size(); }
  [[nodiscard]] int residuals() const;
  // Greatest variance of a row of residuals over that of the sensors' noise.
  [[nodiscard]] double excess() const { return excess_.maxCoeff(); }

  // Segments of so many windows, begun from the gyro's and accelerometer's readings.
  void cut_into(int windows);
  // Joins pairs of segments.
  void join();

  // Half the sum of the squared whitened residuals, the priors included, at the parameters and the run's unknowns.
  // Infinite where the model does not roll.
  [[nodiscard]] double cost(const Eigen::VectorXd& values);
  // Linearises at `values`. damping: of Levenberg and Marquardt, relative to the diagonal.
  Reduced linearise(const Eigen::VectorXd& values, double damping);
  // The run's own unknowns after a step of the parameters; take back with restore().
  void step(const Eigen::VectorXd& parameters_step);
  void restore() {
    own_ = before_;
    segments_ = segments_before_;
    place_masses(own_);
  }

  // Sets the variances of the residuals by what is left of them, at least those of the sensors' noise.
  void set_variances();
  // Expects accelerations of so much beside the sensors' noise, in m/s^2 rms: masses that swing.
  void expect_swing(double rms_mps2);
  // Sets the lag of the masses along the present trajectory, where they are moved by steppers.
  void set_lag(const Eigen::VectorXd& values);

  // Covariance of the pull, from the residuals as they are: their autocorrelation over `lags` windows (Bartlett's
  // weights), and the priors' share. At the last linearise().
  [[nodiscard]] Eigen::MatrixXd pull_covariance(int lags) const;

  // Greatest f_s / N and least N of the present trajectory, and the farthest place from the start.
  struct Contact {
    double mu_required = 0, least_normal_n = 0, farthest_m = 0;
  };
  [[nodiscard]] Contact contact(const Eigen::VectorXd& values);

 private:
  static constexpr int kRows = 6;     // gyro, accelerometer
  static constexpr int kErrors = 12;  // scale and misalignment of the gyro, then of the accelerometer
  static constexpr int kBiases = 6;   // of a knot
  static constexpr int kStart = 8;    // phi, Omega, place
  using Row = Eigen::Matrix<double, kRows, 1>;

  struct Window {
    Row measured = Row::Zero();
    double samples = 0;
    bool gyro = false, accelerometer = false;  // usable
    [[nodiscard]] bool usable(int row) const { return row < 3 ? gyro : accelerometer; }
  };
  struct Segment {
    int first, windows;
    BallState start;
  };
  struct Prediction {
    std::vector<Row> truth;              // means over the windows
    std::vector<Eigen::Vector2d> fixes;  // at the fixes of the segment
    bool rolls = true;
  };
  // Derivatives of a segment's prediction, by differences. Columns: the parameters, attitude (3) and rate (3) at the
  // start, then the masses' places and lags.
  struct Slopes {
    std::vector<Eigen::MatrixXd> by_window;  // kRows rows each
    std::vector<Eigen::MatrixXd> by_fix;     // 2 rows each
  };

  void take_samples();
  void set_sensor_noise();
  [[nodiscard]] Row held_variance() const;
  [[nodiscard]] Prediction predict(const plan::Robot& robot, const Segment& segment, const BallState& start);
  // Places the masses by these unknowns.
  void place_masses(const Eigen::VectorXd& own);
  [[nodiscard]] Eigen::Index masses_at() const { return kErrors; }
  [[nodiscard]] Eigen::Index biases_at(int knot) const {
    return kErrors + 2 * static_cast<Eigen::Index>(parameters_->masses()) + kBiases * static_cast<Eigen::Index>(knot);
  }
  [[nodiscard]] Eigen::Index start_at(std::size_t segment) const {
    return biases_at(knots_) + kStart * static_cast<Eigen::Index>(segment);
  }
  [[nodiscard]] Eigen::Index unknowns() const { return start_at(segments_.size()); }
  [[nodiscard]] std::pair<int, double> knot_of(int window) const;
  [[nodiscard]] Row read(const Row& truth, int window) const;
  [[nodiscard]] Row variance(int window) const;
  [[nodiscard]] double data_cost(const Segment& segment, const Prediction& predicted) const;
  [[nodiscard]] double prior_cost() const;
  void add_priors(Eigen::MatrixXd& h, Eigen::VectorXd& g) const;
  // Adds one segment's part to the information and the pull of all unknowns.
  void add_segment(const Eigen::VectorXd& values, std::size_t index, Eigen::MatrixXd& h, Eigen::VectorXd& g);
  void add_windows(std::size_t index, const Prediction& here, const Slopes& slopes, Eigen::MatrixXd& h,
                   Eigen::VectorXd& g);
  void add_fixes(std::size_t index, const Prediction& here, const Slopes& slopes, Eigen::MatrixXd& h,
                 Eigen::VectorXd& g);
  [[nodiscard]] Slopes slopes(const Eigen::VectorXd& values, const Segment& segment, std::size_t fixes);
  [[nodiscard]] Eigen::Index slopes_of_masses() const;

  Recording recording_;
  const Parameters* parameters_;
  Timeline timeline_;
  std::vector<Window> window_;
  std::vector<Segment> segments_, segments_before_;
  int knots_ = 2;
  double knot_spacing_windows_ = 1;
  Eigen::VectorXd own_, before_;  // errors, masses and biases
  Row sample_variance_ = Row::Zero(), excess_ = Row::Ones();
  std::vector<Node> nodes_;

  // The last linearise() leaves these.
  Eigen::MatrixXd own_information_, coupling_;  // H_ll (undamped), H_lp
  Eigen::VectorXd own_pull_;
  Eigen::LDLT<Eigen::MatrixXd> own_solver_;
  std::vector<Eigen::VectorXd> scores_;  // of each window: J^T W r of the parameters, then of the own unknowns
  std::vector<Row> residual_;
  Eigen::MatrixXd prior_information_;  // of the own unknowns
};

}  // namespace ballast::identify
