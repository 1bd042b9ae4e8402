// The yardstick: how fast this machine integrates the paper's ball when nothing but that ball has to be right. Written
// by hand for three masses on circles about the geometric centre whose motion pieces meet at the same instants. It has
// no events, no extrema, and no regime but rolling. Only the benchmarks use it.
//
// Equations: physics.md section 4, rolling, summed about the geometric centre. On such a circle zeta'' = -zeta, zeta .
// zeta' = 0 and zeta x zeta' = R^2 n with n fixed in the body. A mass's part of the sums is then
//   S  += m zeta,   J += m (R^2 1 - zeta zeta^T),   of which R^2 1 is constant
//   G  += Omega x (2 thetadot m zeta') - thetadot^2 m zeta + thetaddot m zeta'
//   E  += -2 thetadot (zeta . Omega) m zeta' + thetaddot m R^2 n
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "sim/integrators/dop853.h"
#include "sim/scenario/scenario.h"
#include "tools/integrators/embedded_pair.h"

namespace ballast::benchmarks {

class LimitBall {
 public:
  static constexpr std::size_t kSize = 9;  // q (w, x, y, z), Omega, z_1, z_2
  using State = sim::Dop853<kSize>::State;

  struct Forces {
    double normal_n;
    double static_friction_n;
  };

  // Throws std::invalid_argument if the scenario is not such a ball.
  explicit LimitBall(const sim::Scenario& s) {
    if (s.masses.size() != kMasses || s.external_force_W_n.norm() != 0 || !s.force_table.times_s.empty() ||
        s.drag.coefficient_kgpm != 0)
      throw std::invalid_argument("the yardstick is for three masses and no external force");
    r_ = s.ball.radius_m;
    g_ = s.gravity_mps2;
    total_ = s.ball.mass_kg;
    const Eigen::Vector3d chi = s.ball.center_of_mass_B_m;
    inertia_ = s.ball.inertia_kgm2.asDiagonal();
    inertia_ += s.ball.mass_kg * (chi.squaredNorm() * Eigen::Matrix3d::Identity() - chi * chi.transpose());
    moment_ = s.ball.mass_kg * chi;
    for (std::size_t i = 0; i < kMasses; ++i) {
      const sim::Mass& from = s.masses[i];
      const firmware::Rail& rail = from.rail;
      if (rail.shape != firmware::RailShape::kCircle || rail.origin_B_m.norm() != 0 ||
          from.motion.size() + 1 > pieces_.size() || from.motion.size() != s.masses[0].motion.size())
        throw std::invalid_argument("the yardstick is for circles about the centre, pushed once");
      Mass& to = mass_[i];
      to.m = from.mass_kg;
      total_ += to.m;
      const double m_r2 = to.m * rail.radius_m * rail.radius_m;
      to.a = rail.radius_m * rail.axis_cos_B;
      to.b = rail.radius_m * rail.axis_sin_B;
      to.n = m_r2 * rail.axis_cos_B.cross(rail.axis_sin_B);
      inertia_.diagonal().array() += m_r2;
      double start = 0, position = from.initial_position, velocity = from.initial_velocity;
      piece_count_ = 0;
      const auto add = [&](double acceleration, double jerk) {
        Piece& piece = pieces_[piece_count_++];
        if (i > 0 && piece.start_s != start)
          throw std::invalid_argument("the yardstick's motion pieces meet at the same instants");
        piece.start_s = start;
        piece.motion[i] = {position, velocity, acceleration / 2, jerk / 6};
      };
      for (const sim::MotionPiece& p : from.motion) {
        const double h = p.duration_s, a0 = p.acceleration_start, a1 = p.acceleration_end;
        add(a0, (a1 - a0) / h);
        position += h * velocity + h * h * (2 * a0 + a1) / 6;
        velocity += h * (a0 + a1) / 2;
        start += h;
      }
      add(0, 0);
    }
    const Eigen::Quaterniond& q = s.initial.orientation;
    const Eigen::Vector3d& omega = s.initial.angular_velocity_B_radps;
    initial_ = {
        q.w(), q.x(), q.y(), q.z(), omega[0], omega[1], omega[2], s.initial.position_W_m[0], s.initial.position_W_m[1]};
  }

  [[nodiscard]] const State& initial() const { return initial_; }
  [[nodiscard]] std::size_t piece_count() const { return piece_count_; }
  [[nodiscard]] double piece_start_s(std::size_t piece) const { return pieces_[piece].start_s; }

  // The right-hand side, with N and f_s, of one motion piece.
  Forces derivative(std::size_t piece, double time_s, const double* y, double* dydt) const {
    return piece + 1 < piece_count_ ? derivative<false>(pieces_[piece], time_s, y, dydt)
                                    : derivative<true>(pieces_[piece], time_s, y, dydt);
  }

  // Integrates from t = 0 to end_s and returns the number of right-hand sides. Starts anew where motion pieces meet.
  // Throws std::runtime_error if the integrator gives up.
  std::int64_t integrate(double end_s, double tolerance, State& y) const {
    System system{*this};
    integrators::EmbeddedPair<System, sim::Dop853<kSize>, 12> dop853(system, {.tolerance = tolerance});
    y = initial_;
    for (; system.piece < piece_count_ && piece_start_s(system.piece) < end_s; ++system.piece) {
      const double to = system.piece + 1 < piece_count_ ? std::min(piece_start_s(system.piece + 1), end_s) : end_s;
      dop853.start(piece_start_s(system.piece), y);
      while (dop853.time() < to) {
        if (!dop853.step(to)) throw std::runtime_error("DOP853 gave up");
      }
      y = dop853.state();
    }
    return dop853.counters().right_hand_sides;
  }

 private:
  // The ball in one motion piece, as the integrator takes it.
  struct System {
    const LimitBall& ball;
    std::size_t piece = 0;
    [[nodiscard]] static constexpr std::size_t size() { return kSize; }
    void rhs(double t, const double* y, double* f) const { ball.derivative(piece, t, y, f); }
  };
  static constexpr std::size_t kMasses = 3;
  using Vector = Eigen::Vector3d;
  struct Cubic {
    double position, velocity, half_acceleration, sixth_jerk;
  };
  struct Piece {
    double start_s = 0;
    std::array<Cubic, kMasses> motion{};
  };
  struct Mass {
    double m;
    Vector a, b;  // R times the circle's axes
    Vector n;     // m R^2 times its normal
  };

  // sin and cos to 2e-16 for |x| < 1e5: x less a multiple of pi / 2 (its first 33 and following 53 bits), then the
  // polynomials of fdlibm's k_sin.c and k_cos.c. libm's sincos takes three times as many instructions.
  [[gnu::always_inline]] static void sine_and_cosine(double x, double& sine, double& cosine) {
    const double shift = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer, in the low bits
    const double shifted = x * 0.63661977236758134308 + shift;
    const double n = shifted - shift;
    const auto quadrant = std::bit_cast<std::uint64_t>(shifted);
    const double r = (x - n * 1.57079632673412561417) - n * 6.07710050650619224932e-11, z = r * r;
    double s = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10;
    s = 2.75573137070700676789e-06 + z * s;
    s = -1.98412698298579493134e-04 + z * s;
    s = 8.33333333332248946124e-03 + z * s;
    s = -1.66666666666666324348e-01 + z * s;
    s = r + r * z * s;
    double c = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11;
    c = -2.75573143513906633035e-07 + z * c;
    c = 2.48015872894767294178e-05 + z * c;
    c = -1.38888888888741095749e-03 + z * c;
    c = 4.16666666666666019037e-02 + z * c;
    c = 1 - 0.5 * z + z * z * c;
    // Odd quadrants exchange the two; sin changes sign in quadrants 2 and 3, cos in 1 and 2.
    const std::uint64_t odd = -(quadrant & 1), sb = std::bit_cast<std::uint64_t>(s),
                        cb = std::bit_cast<std::uint64_t>(c);
    const std::uint64_t exchanged = (sb ^ cb) & odd;
    sine = std::bit_cast<double>((sb ^ exchanged) ^ ((quadrant & 2) << 62));
    cosine = std::bit_cast<double>((cb ^ exchanged) ^ (((quadrant + 1) & 2) << 62));
  }

  // kCoasting: theta'' = 0.
  template <bool kCoasting>
  Forces derivative(const Piece& p, double time_s, const double* y, double* dydt) const {
    const double q0 = y[0], q1 = y[1], q2 = y[2], q3 = y[3];
    const Vector omega(y[4], y[5], y[6]);
    const double t = time_s - p.start_s;

    // Sines first, so that the three run beside one another.
    double sines[kMasses], cosines[kMasses];
    for (std::size_t i = 0; i < kMasses; ++i) {
      const Cubic& c = p.motion[i];
      double theta = c.velocity;
      if constexpr (!kCoasting) theta += t * (c.half_acceleration + t * c.sixth_jerk);
      theta = c.position + t * theta;
      sine_and_cosine(theta, sines[i], cosines[i]);
    }

    Vector S = moment_, G = Vector::Zero(), E = Vector::Zero();
    Vector moved = Vector::Zero();  // sum of thetadot m zeta'
    double j00 = inertia_(0, 0), j01 = inertia_(0, 1), j02 = inertia_(0, 2);
    double j11 = inertia_(1, 1), j12 = inertia_(1, 2), j22 = inertia_(2, 2);
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kMasses; ++i) {
      const Mass& mass = mass_[i];
      const Cubic& c = p.motion[i];
      double rate = c.velocity;
      if constexpr (!kCoasting) rate += t * (2 * c.half_acceleration + t * (3 * c.sixth_jerk));
      const Vector zeta = cosines[i] * mass.a + sines[i] * mass.b;
      const Vector m_zeta = mass.m * zeta, m_slope = mass.m * (cosines[i] * mass.b - sines[i] * mass.a);
      S += m_zeta;
      j00 -= m_zeta[0] * zeta[0];
      j01 -= m_zeta[0] * zeta[1];
      j02 -= m_zeta[0] * zeta[2];
      j11 -= m_zeta[1] * zeta[1];
      j12 -= m_zeta[1] * zeta[2];
      j22 -= m_zeta[2] * zeta[2];
      moved += rate * m_slope;
      G -= rate * rate * m_zeta;
      E -= 2 * rate * zeta.dot(omega) * m_slope;
      if constexpr (!kCoasting) {
        const double acceleration = 2 * c.half_acceleration + 6 * t * c.sixth_jerk;
        G += acceleration * m_slope;
        E += acceleration * mass.n;
      }
    }

    const double weight = total_ * g_, m_r2 = total_ * r_ * r_;
    const Vector up(2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), 1 - 2 * (q1 * q1 + q2 * q2));
    // G = Omega x (Omega x S + 2 sum thetadot m zeta') + ... + M g Gamma
    G += omega.cross(Vector(omega.cross(S) + 2 * moved)) + weight * up;
    // E = Omega x J Omega + g S x Gamma + ...
    const Vector spin(j00 * omega[0] + j01 * omega[1] + j02 * omega[2],
                      j01 * omega[0] + j11 * omega[1] + j12 * omega[2],
                      j02 * omega[0] + j12 * omega[1] + j22 * omega[2]);
    E += omega.cross(spin) + g_ * S.cross(up);

    // A Omegadot = -(E + r Gamma x G), A = J + r (2 S.Gamma 1 - Gamma S^T - S Gamma^T) + M r^2 (1 - Gamma Gamma^T)
    const double diagonal = 2 * r_ * S.dot(up) + m_r2;
    const Vector v = r_ * S + m_r2 / 2 * up;
    const double a00 = j00 + diagonal - 2 * up[0] * v[0], a01 = j01 - up[0] * v[1] - v[0] * up[1],
                 a02 = j02 - up[0] * v[2] - v[0] * up[2], a11 = j11 + diagonal - 2 * up[1] * v[1],
                 a12 = j12 - up[1] * v[2] - v[1] * up[2], a22 = j22 + diagonal - 2 * up[2] * v[2];
    const Vector b = -E - r_ * up.cross(G);
    // By the cofactors of A.
    const Vector k0(a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11);
    const Vector k1(k0[1], a00 * a22 - a02 * a02, a01 * a02 - a00 * a12);
    const Vector k2(k0[2], k1[2], a00 * a11 - a01 * a01);
    const double inverse = 1 / (a00 * k0[0] + a01 * k0[1] + a02 * k0[2]);
    const Vector turn(inverse * k0.dot(b), inverse * k1.dot(b), inverse * k2.dot(b));

    // qdot = q Omega / 2, zdot = Lambda (Omega x r Gamma)
    dydt[0] = -0.5 * (q1 * omega[0] + q2 * omega[1] + q3 * omega[2]);
    dydt[1] = 0.5 * (q0 * omega[0] + q2 * omega[2] - q3 * omega[1]);
    dydt[2] = 0.5 * (q0 * omega[1] + q3 * omega[0] - q1 * omega[2]);
    dydt[3] = 0.5 * (q0 * omega[2] + q1 * omega[1] - q2 * omega[0]);
    for (int j = 0; j < 3; ++j) dydt[4 + j] = turn[j];
    const Vector z = r_ * omega.cross(up);
    dydt[7] = z[0] + 2 * (q1 * (q2 * z[1] + q3 * z[2]) - (q2 * q2 + q3 * q3) * z[0] + q0 * (q2 * z[2] - q3 * z[1]));
    dydt[8] = z[1] + 2 * (q2 * (q1 * z[0] + q3 * z[2]) - (q1 * q1 + q3 * q3) * z[1] + q0 * (q3 * z[0] - q1 * z[2]));

    // R = M a + Omegadot x S + G with a = Omegadot x r Gamma
    const Vector force = turn.cross(Vector(total_ * r_ * up + S)) + G;
    const double normal = force.dot(up);
    return {normal, (force - normal * up).norm()};
  }

  double r_, g_, total_;
  Vector moment_;            // of the shell
  Eigen::Matrix3d inertia_;  // constant part, about the centre
  std::array<Mass, kMasses> mass_;
  std::array<Piece, 4> pieces_;
  std::size_t piece_count_ = 0;
  State initial_;
};

}  // namespace ballast::benchmarks
