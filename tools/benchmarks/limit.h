// The yardstick: how fast this machine goes on the paper's ball when nothing but that ball has to be right. Plain
// doubles, written out by hand for three masses on circles about the geometric centre whose motion pieces meet at the
// same instants; no library, no events, no extrema, no other regime than rolling. Not used by anything but the
// benchmarks.
//
// Equations: physics.md section 4, rolling, summed about the geometric centre. On such a circle zeta'' = -zeta, zeta .
// zeta' = 0 and zeta x zeta' = R^2 n with n fixed in the body, which leaves of a mass's part of the sums
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
    Eigen::Matrix3d inertia = s.ball.inertia_kgm2.asDiagonal();
    inertia += s.ball.mass_kg * (chi.squaredNorm() * Eigen::Matrix3d::Identity() - chi * chi.transpose());
    for (int j = 0; j < 3; ++j) moment_[j] = s.ball.mass_kg * chi[j];
    for (std::size_t i = 0; i < kMasses; ++i) {
      const sim::Mass& from = s.masses[i];
      const firmware::Rail& rail = from.rail;
      if (rail.shape != firmware::RailShape::kCircle || rail.origin_B_m.norm() != 0 ||
          from.motion.size() + 1 > pieces_.size() || from.motion.size() != s.masses[0].motion.size())
        throw std::invalid_argument("the yardstick is for circles about the centre, pushed once");
      Mass& to = mass_[i];
      to.m = from.mass_kg;
      total_ += to.m;
      const Eigen::Vector3d normal = rail.axis_cos_B.cross(rail.axis_sin_B);
      const double m_r2 = to.m * rail.radius_m * rail.radius_m;
      for (int j = 0; j < 3; ++j) {
        to.a[j] = rail.radius_m * rail.axis_cos_B[j];
        to.b[j] = rail.radius_m * rail.axis_sin_B[j];
        to.n[j] = m_r2 * normal[j];
        inertia(j, j) += m_r2;
      }
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
    inertia_[0] = inertia(0, 0);
    inertia_[1] = inertia(0, 1);
    inertia_[2] = inertia(0, 2);
    inertia_[3] = inertia(1, 1);
    inertia_[4] = inertia(1, 2);
    inertia_[5] = inertia(2, 2);

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
  struct Cubic {
    double position, velocity, half_acceleration, sixth_jerk;
  };
  struct Piece {
    double start_s = 0;
    std::array<Cubic, kMasses> motion{};
  };
  struct Mass {
    double m;
    double a[3], b[3];  // R times the circle's axes
    double n[3];        // m R^2 times its normal
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
    const double w0 = y[4], w1 = y[5], w2 = y[6];
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

    double s0 = moment_[0], s1 = moment_[1], s2 = moment_[2];
    double j00 = inertia_[0], j01 = inertia_[1], j02 = inertia_[2];
    double j11 = inertia_[3], j12 = inertia_[4], j22 = inertia_[5];
    double c0 = 0, c1 = 0, c2 = 0;     // sum of thetadot m zeta'
    double gx0 = 0, gx1 = 0, gx2 = 0;  // the rest of G
    double e0 = 0, e1 = 0, e2 = 0;
#pragma GCC unroll 3
    for (std::size_t i = 0; i < kMasses; ++i) {
      const Mass& mass = mass_[i];
      const Cubic& c = p.motion[i];
      double rate = c.velocity;
      if constexpr (!kCoasting) rate += t * (2 * c.half_acceleration + t * (3 * c.sixth_jerk));
      const double sine = sines[i], cosine = cosines[i];
      const double z0 = cosine * mass.a[0] + sine * mass.b[0];
      const double z1 = cosine * mass.a[1] + sine * mass.b[1];
      const double z2 = cosine * mass.a[2] + sine * mass.b[2];
      const double d0 = mass.m * (cosine * mass.b[0] - sine * mass.a[0]);
      const double d1 = mass.m * (cosine * mass.b[1] - sine * mass.a[1]);
      const double d2 = mass.m * (cosine * mass.b[2] - sine * mass.a[2]);
      const double m0 = mass.m * z0, m1 = mass.m * z1, m2 = mass.m * z2;
      s0 += m0;
      s1 += m1;
      s2 += m2;
      j00 -= m0 * z0;
      j01 -= m0 * z1;
      j02 -= m0 * z2;
      j11 -= m1 * z1;
      j12 -= m1 * z2;
      j22 -= m2 * z2;
      c0 += rate * d0;
      c1 += rate * d1;
      c2 += rate * d2;
      const double square = rate * rate;
      gx0 -= square * m0;
      gx1 -= square * m1;
      gx2 -= square * m2;
      const double along = -2 * rate * (z0 * w0 + z1 * w1 + z2 * w2);
      e0 += along * d0;
      e1 += along * d1;
      e2 += along * d2;
      if constexpr (!kCoasting) {
        const double acceleration = 2 * c.half_acceleration + 6 * t * c.sixth_jerk;
        gx0 += acceleration * d0;
        gx1 += acceleration * d1;
        gx2 += acceleration * d2;
        e0 += acceleration * mass.n[0];
        e1 += acceleration * mass.n[1];
        e2 += acceleration * mass.n[2];
      }
    }

    const double u0 = 2 * (q1 * q3 - q0 * q2), u1 = 2 * (q2 * q3 + q0 * q1), u2 = 1 - 2 * (q1 * q1 + q2 * q2);

    // G = Omega x (Omega x S + 2 sum thetadot m zeta') + ... + M g Gamma
    const double h0 = w1 * s2 - w2 * s1 + 2 * c0, h1 = w2 * s0 - w0 * s2 + 2 * c1, h2 = w0 * s1 - w1 * s0 + 2 * c2;
    const double weight = total_ * g_;
    gx0 += w1 * h2 - w2 * h1 + weight * u0;
    gx1 += w2 * h0 - w0 * h2 + weight * u1;
    gx2 += w0 * h1 - w1 * h0 + weight * u2;
    // E = Omega x J Omega + g S x Gamma + ...
    const double l0 = j00 * w0 + j01 * w1 + j02 * w2, l1 = j01 * w0 + j11 * w1 + j12 * w2,
                 l2 = j02 * w0 + j12 * w1 + j22 * w2;
    e0 += w1 * l2 - w2 * l1 + g_ * (s1 * u2 - s2 * u1);
    e1 += w2 * l0 - w0 * l2 + g_ * (s2 * u0 - s0 * u2);
    e2 += w0 * l1 - w1 * l0 + g_ * (s0 * u1 - s1 * u0);

    // A Omegadot = -(E + r Gamma x G), A = J + r (2 S.Gamma 1 - Gamma S^T - S Gamma^T) + M r^2 (1 - Gamma Gamma^T)
    const double m_r2 = total_ * r_ * r_, diagonal = 2 * r_ * (s0 * u0 + s1 * u1 + s2 * u2) + m_r2;
    const double v0 = r_ * s0 + m_r2 / 2 * u0, v1 = r_ * s1 + m_r2 / 2 * u1, v2 = r_ * s2 + m_r2 / 2 * u2;
    const double a00 = j00 + diagonal - 2 * u0 * v0, a11 = j11 + diagonal - 2 * u1 * v1,
                 a22 = j22 + diagonal - 2 * u2 * v2;
    const double a01 = j01 - u0 * v1 - v0 * u1, a02 = j02 - u0 * v2 - v0 * u2, a12 = j12 - u1 * v2 - v1 * u2;
    const double b0 = -e0 - r_ * (u1 * gx2 - u2 * gx1), b1 = -e1 - r_ * (u2 * gx0 - u0 * gx2),
                 b2 = -e2 - r_ * (u0 * gx1 - u1 * gx0);
    const double k00 = a11 * a22 - a12 * a12, k01 = a02 * a12 - a01 * a22, k02 = a01 * a12 - a02 * a11;
    const double k11 = a00 * a22 - a02 * a02, k12 = a01 * a02 - a00 * a12, k22 = a00 * a11 - a01 * a01;
    const double inverse = 1 / (a00 * k00 + a01 * k01 + a02 * k02);
    const double x0 = inverse * (k00 * b0 + k01 * b1 + k02 * b2), x1 = inverse * (k01 * b0 + k11 * b1 + k12 * b2),
                 x2 = inverse * (k02 * b0 + k12 * b1 + k22 * b2);

    // qdot = q Omega / 2, zdot = Lambda (Omega x r Gamma)
    dydt[0] = -0.5 * (q1 * w0 + q2 * w1 + q3 * w2);
    dydt[1] = 0.5 * (q0 * w0 + q2 * w2 - q3 * w1);
    dydt[2] = 0.5 * (q0 * w1 + q3 * w0 - q1 * w2);
    dydt[3] = 0.5 * (q0 * w2 + q1 * w1 - q2 * w0);
    dydt[4] = x0;
    dydt[5] = x1;
    dydt[6] = x2;
    const double r0 = r_ * (w1 * u2 - w2 * u1), r1 = r_ * (w2 * u0 - w0 * u2), r2 = r_ * (w0 * u1 - w1 * u0);
    dydt[7] = r0 + 2 * (q1 * (q2 * r1 + q3 * r2) - (q2 * q2 + q3 * q3) * r0 + q0 * (q2 * r2 - q3 * r1));
    dydt[8] = r1 + 2 * (q2 * (q1 * r0 + q3 * r2) - (q1 * q1 + q3 * q3) * r1 + q0 * (q3 * r0 - q1 * r2));

    // R = M a + Omegadot x S + G with a = Omegadot x r Gamma
    const double p0 = total_ * r_ * u0 + s0, p1 = total_ * r_ * u1 + s1, p2 = total_ * r_ * u2 + s2;
    const double f0 = x1 * p2 - x2 * p1 + gx0, f1 = x2 * p0 - x0 * p2 + gx1, f2 = x0 * p1 - x1 * p0 + gx2;
    const double normal = f0 * u0 + f1 * u1 + f2 * u2;
    const double t0 = f0 - normal * u0, t1 = f1 - normal * u1, t2 = f2 - normal * u2;
    return {normal, std::sqrt(t0 * t0 + t1 * t1 + t2 * t2)};
  }

  double r_, g_, total_;
  double moment_[3];   // of the shell
  double inertia_[6];  // constant part, about the centre: 00 01 02 11 12 22
  std::array<Mass, kMasses> mass_;
  std::array<Piece, 4> pieces_;
  std::size_t piece_count_ = 0;
  State initial_;
};

}  // namespace ballast::benchmarks
