// Feedback along a reference: u = u_plan - K e (reference.h), with e's integral of the place's error, so that a
// constant disturbance leaves no offset of the place.
//
// Invariants: fixed size, no heap, no loop that depends on values. The same bits on every processor: no libm but sqrt.
#pragma once

#include "firmware/tracking/reference.h"

namespace ballast::firmware {

// Place of the ball from its turning: zdot = omega x r e3, integrated by the trapezoidal rule from tick to tick. A ball
// that slips is elsewhere.
struct DeadReckoning {
  Vector2 position_W_m = Vector2::Zero();
  Vector2 velocity_W_mps = Vector2::Zero();  // at the last tick
};
void begin_reckoning(const Vector2& position_W_m, const BallState& ball, Real radius_m, DeadReckoning& reckoning);
void advance_reckoning(const BallState& ball, Real radius_m, Real period_s, DeadReckoning& reckoning);

// Velocity of the geometric centre of a ball that rolls.
[[nodiscard]] Vector2 rolling_velocity(const Quaternion& orientation, const Vector3& angular_velocity_B_radps,
                                       Real radius_m);

// Reference at a plan time, which is clamped to the table. Between rows attitude and place are cubics through both rows
// with the derivatives that Omega gives them there; Omega is a cubic with the slopes of its neighbours' chords.
[[nodiscard]] BallState reference_at(const ReferenceTable& table, int masses, Real radius_m, Wide time_s);

// The table covers this plan time, or is held after its end.
[[nodiscard]] bool tracks_at(const ReferenceTable& table, Wide time_s);

// The table is over at this plan time, and its last row is held. The ball may have turned about the vertical since: e
// is that of a ball turned back, with the place's error turned with it, and without Omega about the vertical.
[[nodiscard]] bool holds_at(const ReferenceTable& table, Wide time_s);

// The masses' part of e.
struct MassError {
  PerMass<Real> position{};  // commanded - planned, rail units
  PerMass<Real> velocity{};
};

// A place that is further off counts as this many radii off, in its direction. Masses that lack the speed for the whole
// correction at once would swing ever more widely; so a ball that was pushed far away comes back at a bounded speed.
inline constexpr Real kMostPlaceError = Real(0.1);

// e at a plan time, which is clamped to the table and goes on at this rate. The rotation vector is taken as 2 sin(angle
// / 2) about its axis: 1 % short at 0.5 rad, and bounded. Entries beyond error_size(masses) are 0.
using ErrorVector = std::array<Real, kMostErrorSize>;
[[nodiscard]] ErrorVector tracking_error(const ReferenceTable& table, int masses, Real radius_m, Wide time_s, Real rate,
                                         const BallState& ball, const MassError& mass_error,
                                         const Vector2& integral_W_ms);

// The place's error in e.
[[nodiscard]] inline Vector2 place_error(const ErrorVector& e, int masses) {
  const auto first = static_cast<std::size_t>(2 * masses + 6);
  return {e[first], e[first + 1]};
}

// K e at a plan time, which is clamped to the table; K is linear between rows. Rail unit / s^2.
[[nodiscard]] PerMass<Real> feedback(const ReferenceTable& table, int masses, Wide time_s, const ErrorVector& e);

}  // namespace ballast::firmware
