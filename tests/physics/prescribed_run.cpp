#include "tests/physics/prescribed_run.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "firmware/motion/profile.h"
#include "tools/program/params.h"

namespace ballast::test {

firmware::BallParams ball_params(const sim::Scenario& scenario) {
  firmware::BallParams ball;
  if (const auto refusal = program::to_ball_params(scenario, ball)) throw std::runtime_error(*refusal);
  return ball;
}

struct PrescribedRun::Impl {
  Law law;
  std::vector<firmware::Profile> profiles;
  std::vector<double> knots;
  double time_s = 0;
  double side_s = 0;  // a time inside the smooth stretch being integrated, to choose the side of a jump
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  void* cvode = nullptr;
  SUNNonlinearSolver solver = nullptr;

  firmware::MassMotion masses(double t, double side) const {
    firmware::MassMotion m;
    for (std::size_t i = 0; i < profiles.size(); ++i) {
      const auto& cubic = profiles[i].cubic(profiles[i].locate(side).index);
      const double s = t - profiles[i].cubic_start_s(profiles[i].locate(side).index);
      m.position[i] = cubic.position + s * (cubic.velocity + s * (cubic.acceleration / 2 + s * cubic.jerk / 6));
      m.velocity[i] = cubic.velocity + s * (cubic.acceleration + s * cubic.jerk / 2);
      m.acceleration[i] = cubic.acceleration + s * cubic.jerk;
    }
    return m;
  }

  static int derivative(double t, N_Vector y, N_Vector ydot, void* self) {
    const auto& run = *static_cast<const Impl*>(self);
    run.law(t, run.masses(t, run.side_s), NV_DATA_S(y), NV_DATA_S(ydot));
    return 0;
  }
};

PrescribedRun::PrescribedRun(const sim::Scenario& scenario, const std::vector<double>& y0, Law law,
                             const std::vector<double>& kinks_s)
    : impl_(new Impl) {
  impl_->law = std::move(law);
  for (const double kink_s : kinks_s) {
    if (kink_s > 0) impl_->knots.push_back(kink_s);
  }
  for (const auto& mass : scenario.masses) {
    std::vector<firmware::ProfilePiece> pieces;
    for (const auto& piece : mass.motion) {
      pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
    firmware::Profile profile;
    if (!profile.set(mass.initial_position, mass.initial_velocity, pieces.data(), static_cast<int>(pieces.size()))) {
      throw std::runtime_error("a profile was refused");
    }
    for (int p = 1; p <= profile.piece_count(); ++p) impl_->knots.push_back(profile.cubic_start_s(p));
    impl_->profiles.push_back(profile);
  }
  // CVODE cannot start for less than rounding: knots that coincide up to that are one.
  std::sort(impl_->knots.begin(), impl_->knots.end());
  const auto same = [](double a, double b) { return b - a < 1e-12; };
  impl_->knots.erase(std::unique(impl_->knots.begin(), impl_->knots.end(), same), impl_->knots.end());

  if (SUNContext_Create(nullptr, &impl_->context) != 0) throw std::runtime_error("SUNDIALS context");
  impl_->y = N_VNew_Serial(static_cast<sunindextype>(y0.size()), impl_->context);
  std::copy(y0.begin(), y0.end(), NV_DATA_S(impl_->y));
  impl_->cvode = CVodeCreate(CV_ADAMS, impl_->context);
  CVodeInit(impl_->cvode, &Impl::derivative, 0, impl_->y);
  CVodeSStolerances(impl_->cvode, 1e-13, 1e-14);
  impl_->solver = SUNNonlinSol_FixedPoint(impl_->y, 0, impl_->context);
  CVodeSetNonlinearSolver(impl_->cvode, impl_->solver);
  CVodeSetUserData(impl_->cvode, impl_.get());
  CVodeSetMaxNumSteps(impl_->cvode, 10'000'000);
}

PrescribedRun::~PrescribedRun() {
  CVodeFree(&impl_->cvode);
  SUNNonlinSolFree(impl_->solver);
  N_VDestroy(impl_->y);
  SUNContext_Free(&impl_->context);
}

bool PrescribedRun::advance(double time_s) {
  while (impl_->time_s < time_s) {
    const auto knot = std::upper_bound(impl_->knots.begin(), impl_->knots.end(), impl_->time_s);
    const double target = knot == impl_->knots.end() ? time_s : std::min(time_s, *knot);
    impl_->side_s = (impl_->time_s + target) / 2;
    if (CVodeReInit(impl_->cvode, impl_->time_s, impl_->y) != CV_SUCCESS) return false;
    CVodeSetStopTime(impl_->cvode, target);
    if (CVode(impl_->cvode, target, impl_->y, &impl_->time_s, CV_NORMAL) < 0) return false;
    impl_->time_s = target;
  }
  return true;
}

double PrescribedRun::time_s() const { return impl_->time_s; }
const double* PrescribedRun::y() const { return NV_DATA_S(impl_->y); }
firmware::MassMotion PrescribedRun::masses() const { return impl_->masses(impl_->time_s, impl_->time_s); }

Eigen::Quaterniond attitude(const double* y) { return Eigen::Quaterniond(y[0], y[1], y[2], y[3]).normalized(); }

void attitude_rate(const double* y, const Eigen::Vector3d& w, double* dydt) {
  const Eigen::Quaterniond dq =
      Eigen::Quaterniond(y[0], y[1], y[2], y[3]) * Eigen::Quaterniond(0, w[0] / 2, w[1] / 2, w[2] / 2);
  dydt[0] = dq.w(), dydt[1] = dq.x(), dydt[2] = dq.y(), dydt[3] = dq.z();
}

}  // namespace ballast::test
