#include "firmware/tracking/tracker.h"

#include <cmath>

namespace ballast::firmware {

namespace {

Vector3 turned(const Quaternion& q, const Vector3& v) {
  const Vector3 axis(q.x(), q.y(), q.z());
  const Vector3 t = Real(2) * axis.cross(v);
  return v + q.w() * t + axis.cross(t);
}

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a.w() * b.w() - a.x() * b.x() - a.y() * b.y() - a.z() * b.z(),
          a.w() * b.x() + a.x() * b.w() + a.y() * b.z() - a.z() * b.y(),
          a.w() * b.y() - a.x() * b.z() + a.y() * b.w() + a.z() * b.x(),
          a.w() * b.z() + a.x() * b.y() - a.y() * b.x() + a.z() * b.w()};
}

// A plan time in the table: after row `row`, `part` of a period.
struct Place {
  int row;
  Real part;
};

Place place_of(const ReferenceTable& table, Wide time_s) {
  const Wide last = static_cast<Wide>(table.samples - 1);
  const Wide at = std::fmin(std::fmax(time_s / table.period_s, 0), last);  // NaN gives 0
  int row = static_cast<int>(at);
  if (row > table.samples - 2) row = table.samples - 2;
  return {row, static_cast<Real>(at - static_cast<Wide>(row))};
}

// A row of the table.
class Row {
 public:
  Row(const ReferenceTable& table, int masses, int row)
      : values_(table.values.data() + static_cast<std::ptrdiff_t>(row) * reference_row(masses)) {}

  [[nodiscard]] Real value(int index) const { return static_cast<Real>(values_[index]); }
  [[nodiscard]] Quaternion orientation() const { return {value(0), value(1), value(2), value(3)}; }
  [[nodiscard]] Vector3 angular_velocity() const { return {value(4), value(5), value(6)}; }
  [[nodiscard]] Vector2 place() const { return {value(7), value(8)}; }

 private:
  const float* values_;
};

// Weights of a cubic between two values and two derivatives by the part of the way.
struct Cubic4 {
  Real at_0, at_1, slope_0, slope_1;
  explicit Cubic4(Real s)
      : at_0((1 + 2 * s) * (1 - s) * (1 - s)),
        at_1(s * s * (3 - 2 * s)),
        slope_0(s * (1 - s) * (1 - s)),
        slope_1(s * s * (s - 1)) {}
  template <class V>
  [[nodiscard]] V mix(const V& a, const V& b, const V& a_slope, const V& b_slope) const {
    return at_0 * a + at_1 * b + slope_0 * a_slope + slope_1 * b_slope;
  }
};

using Vector4 = Eigen::Matrix<Real, 4, 1>;

Vector4 coefficients(const Quaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

// dq/ds over a whole period.
Vector4 turning(const Quaternion& q, const Vector3& omega, Real period_s) {
  const Quaternion rate = product(q, Quaternion(0, omega[0], omega[1], omega[2]));
  return period_s / 2 * coefficients(rate);
}

}  // namespace

Vector2 rolling_velocity(const Quaternion& orientation, const Vector3& angular_velocity_B_radps, Real radius_m) {
  const Vector3 omega_W = turned(orientation, angular_velocity_B_radps);
  return {radius_m * omega_W[1], -radius_m * omega_W[0]};
}

void begin_reckoning(const Vector2& position_W_m, const BallState& ball, Real radius_m, DeadReckoning& reckoning) {
  reckoning.position_W_m = position_W_m;
  reckoning.velocity_W_mps = rolling_velocity(ball.orientation, ball.angular_velocity_B_radps, radius_m);
}

void advance_reckoning(const BallState& ball, Real radius_m, Real period_s, DeadReckoning& reckoning) {
  const Vector2 velocity = rolling_velocity(ball.orientation, ball.angular_velocity_B_radps, radius_m);
  reckoning.position_W_m += period_s / 2 * (reckoning.velocity_W_mps + velocity);
  reckoning.velocity_W_mps = velocity;
}

BallState reference_at(const ReferenceTable& table, int masses, Real radius_m, Wide time_s) {
  const Place place = place_of(table, time_s);
  const Row a(table, masses, place.row), b(table, masses, place.row + 1);
  const auto period_s = static_cast<Real>(table.period_s);
  const Cubic4 cubic(place.part);
  const Quaternion qa = a.orientation(), qb = b.orientation();
  const Vector3 wa = a.angular_velocity(), wb = b.angular_velocity();

  BallState out;
  const Vector4 q =
      cubic.mix<Vector4>(coefficients(qa), coefficients(qb), turning(qa, wa, period_s), turning(qb, wb, period_s));
  const Real length = std::sqrt(q.dot(q));
  out.orientation = {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
  out.position_W_m = cubic.mix<Vector2>(a.place(), b.place(), period_s * rolling_velocity(qa, wa, radius_m),
                                        period_s * rolling_velocity(qb, wb, radius_m));
  Vector3 slope_a = wb - wa, slope_b = slope_a;
  if (place.row > 0) slope_a = (wb - Row(table, masses, place.row - 1).angular_velocity()) / 2;
  if (place.row + 2 < table.samples) slope_b = (Row(table, masses, place.row + 2).angular_velocity() - wa) / 2;
  out.angular_velocity_B_radps = cubic.mix<Vector3>(wa, wb, slope_a, slope_b);
  return out;
}

bool tracks_at(const ReferenceTable& table, Wide time_s) {
  return table.holds || time_s <= static_cast<Wide>(table.samples - 1) * table.period_s;
}

namespace {

// The turn about the vertical in a turn of the space frame (swing and twist); none where it is not defined.
Quaternion about_vertical(const Quaternion& turn) {
  const Real size = std::sqrt(turn.w() * turn.w() + turn.z() * turn.z());
  if (!(size > 0)) return {1, 0, 0, 0};
  return {turn.w() / size, 0, 0, turn.z() / size};
}

Vector2 turned_back(const Quaternion& yaw, const Vector2& v_W) {
  const Real cosine = yaw.w() * yaw.w() - yaw.z() * yaw.z(), sine = 2 * yaw.w() * yaw.z();
  return {cosine * v_W[0] + sine * v_W[1], cosine * v_W[1] - sine * v_W[0]};
}

}  // namespace

bool holds_at(const ReferenceTable& table, Wide time_s) {
  return table.holds && time_s >= static_cast<Wide>(table.samples - 1) * table.period_s;
}

ErrorVector tracking_error(const ReferenceTable& table, int masses, Real radius_m, Wide time_s, Real rate,
                           const BallState& ball, const MassError& mass_error, const Vector2& integral_W_ms) {
  const BallState reference = reference_at(table, masses, radius_m, time_s);
  const Quaternion& p = reference.orientation;
  const Quaternion planned_to_B(p.w(), -p.x(), -p.y(), -p.z());
  Quaternion orientation = ball.orientation;
  Vector3 omega = ball.angular_velocity_B_radps - rate * reference.angular_velocity_B_radps;
  Vector2 off = ball.position_W_m - reference.position_W_m, integral = integral_W_ms;
  if (holds_at(table, time_s)) {
    const Quaternion yaw = about_vertical(product(orientation, planned_to_B));
    const Quaternion back(yaw.w(), 0, 0, -yaw.z());
    orientation = product(back, orientation);
    off = turned_back(yaw, off);
    integral = turned_back(yaw, integral);
    omega = ball.angular_velocity_B_radps;
    const Quaternion& q = ball.orientation;
    const Vector3 up_B = turned(Quaternion(q.w(), -q.x(), -q.y(), -q.z()), Vector3(0, 0, 1));
    omega -= omega.dot(up_B) * up_B;
  }
  const Quaternion turn = product(planned_to_B, orientation);
  const Real twice = turn.w() < 0 ? Real(-2) : Real(2);
  const Real distance = std::sqrt(off.dot(off)), most = kMostPlaceError * radius_m;
  if (distance > most) off *= most / distance;

  ErrorVector e{};
  std::size_t size = 0;
  const auto add = [&](Real value) { e[size++] = value; };
  for (int i = 0; i < masses; ++i) add(mass_error.position[static_cast<std::size_t>(i)]);
  for (int i = 0; i < masses; ++i) add(mass_error.velocity[static_cast<std::size_t>(i)]);
  add(twice * turn.x());
  add(twice * turn.y());
  add(twice * turn.z());
  for (int j = 0; j < 3; ++j) add(omega[j]);
  for (int j = 0; j < 2; ++j) add(off[j]);
  for (int j = 0; j < 2; ++j) add(integral[j]);
  return e;
}

PerMass<Real> feedback(const ReferenceTable& table, int masses, Wide time_s, const ErrorVector& e) {
  const Place place = place_of(table, time_s);
  const Row a(table, masses, place.row), b(table, masses, place.row + 1);
  const int size = error_size(masses);
  PerMass<Real> correction{};
  for (int i = 0; i < masses; ++i) {
    Real sum_a = 0, sum_b = 0;
    const int first = kReferenceStateFloats + i * size;
    for (int c = 0; c < size; ++c) {
      sum_a += a.value(first + c) * e[static_cast<std::size_t>(c)];
      sum_b += b.value(first + c) * e[static_cast<std::size_t>(c)];
    }
    correction[static_cast<std::size_t>(i)] = sum_a + place.part * (sum_b - sum_a);
  }
  return correction;
}

}  // namespace ballast::firmware
