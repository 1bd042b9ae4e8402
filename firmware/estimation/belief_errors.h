// Errors of belief: their effect on the slip's speed by rotation (measured_contact.h), and their estimate from it.
//
// A mass that is wrong by m has a moment about the contact point that is wrong by m s_i x (a - g), which the speed by
// rotation takes for slip: on desk_ball 0.03 m/s^2 for half a per cent of the radius in the centre of mass. So does a
// resistance that is not believed. The speed is linear in these errors; its sensitivities are integrals of the masses'
// places, of the attitude, of the direction of motion, and the gain of the rolling velocity. Masses hang, so that a is
// that of the geometric centre.
//
// A Kalman filter with the plausible errors as prior learns them from windows that ended 0.75 s ago. A slip that is
// flagged by then teaches nothing, nor does a speed that its own band does not explain. Each window of slip gets the
// speed that is expected of the errors and the band of what is left. Sums grow from reset() on, in Real: only
// differences over 1.6 s count, to a few per cent, which single precision holds for days. A ball that is held does not
// follow its moments, and adds nothing.
//
// No heap, no loop whose length depends on data. Called from one thread, once per block of 10 ms.
#pragma once

#include <array>

#include "firmware/model/ball.h"

namespace ballast::firmware::contact {

// Epochs of 5 blocks, and windows of slip in epochs. A window with its baseline has up to 32.
inline constexpr int kEpochBlocks = 5, kEpochs = 33;
inline constexpr std::array<int, 5> kWindowEpochs{1, 2, 4, 8, 12};
inline constexpr int kBaselineEpochs = 20, kLeastBaselineEpochs = 4;

// A window from which errors are learned ended so many epochs ago; the same length before it is its baseline.
inline constexpr int kLessonLag = 15, kLessonEpochs = 8;

// The ball at the end of a block.
struct BlockState {
  Matrix3 to_W;              // Lambda
  PerMass<Vector3> place_B;  // zeta_i; as many as there are masses
  Vector2 velocity_W_mps;    // omega x r e3
  Real mass_kg;
  Real lever_kgm;  // Gamma . sum m_i s_i; 0: too short for a speed by rotation
  Real block_s;
  bool held;
};

// Sums since reset(), and the rolling velocity.
struct BeliefSums {
  PerMass<std::array<Real, 2>> offset_W_ms{};  // of each mass from the geometric centre, along the floor
  std::array<Real, 6> axes_s{};                // of the first two rows of Lambda
  std::array<Real, 2> heading_s{};             // of the direction in which the ball rolls
  std::array<Real, 2> velocity_W_mps{};
};

// Errors in units of their prior: of each mass, of the shell's mass and inertia, of its centre of mass along three
// axes, of the rolling resistance.
inline constexpr int kMostErrors = kMaxMasses + 5;
using ErrorVector = std::array<Real, kMostErrors>;

// The errors' effect on a window's speed by rotation: expected, and 1 sigma of the rest.
struct BeliefEffect {
  Vector2 mean_W_mps = Vector2::Zero();
  Real sigma_mps = 0;
  bool known = false;
};

// Plain data; reset() makes it valid.
struct BeliefMeter {
  BeliefSums sums;
  std::array<BeliefSums, kEpochs> starts{};  // of epochs, the newest before next_epoch
  int epoch_block = 0;                       // blocks of the epoch under way, 1..kEpochBlocks; 0: none yet
  int next_epoch = 0, epoch_count = 0;
  int next_window = 0;  // whose effect is found next
  ErrorVector mean{};
  std::array<ErrorVector, kMostErrors> covariance{};
  std::array<BeliefEffect, kWindowEpochs.size()> effects{};  // up to 0.15 s old
};

void reset(BeliefMeter& meter);

// Adds a block.
void add(const BallParams& ball, const BlockState& state, BeliefMeter& meter);

// Finds the effect on one window: another one in each call.
void expect(const BallParams& ball, const BlockState& state, BeliefMeter& meter);

// The component of which this block can learn, 0 or 1; -1: this one calls expect(). They share the work of an epoch.
int component_to_learn(const BeliefMeter& meter);

// Learns from component j of the lesson's speed by rotation less that of its baseline. `noise_m2ps2`: variance of that
// difference with true belief.
void learn(const BallParams& ball, const BlockState& state, std::size_t j, Real speed_mps, Real noise_m2ps2,
           BeliefMeter& meter);

}  // namespace ballast::firmware::contact
