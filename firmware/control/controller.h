// The controller: a step function from (inputs, state, parameters) to (outputs, state), called once per control tick.
//
// Invariants: time is the tick number. No heap, exceptions, RTTI, recursion, unbounded loops or virtual calls. One
// thread calls it, never an interrupt.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/plan.h"
#include "firmware/control/state.h"
#include "firmware/control/status.h"

namespace ballast::firmware {

// State before the first tick: disarmed, masses holding at their initial positions.
void reset(const ControllerParams& params, ControllerState& state);

// A control tick consists of four calls, in this order. `params` must have been accepted by validate().
//
// tick() decides what the masses do and makes the steps of inputs.tick + 1. Nothing in it waits for a prediction.
// - START in tick k: profile time 0 is the start of tick k + 1. The first motion starts with the parameters' initial
//   position and velocity. A later one (after a stop, a move, or a trip and reset) runs the same pieces from where the
//   masses stand, at rest; it is refused if that breaks a limit or leaves a rail. The motion after its last piece is
//   not checked, because its length is not known here.
// - MOVE in tick k, armed: plan_move() plans it for each mass asked, all in the same time. The move is then pending
//   while it is predicted, and the masses hold. It begins with the start of tick k + 1 + pending_ticks(). A stop
//   cancels a pending move, and so does a fault (kCancelled). When the masses have arrived they hold, and the mode is
//   armed again. A target at an end of its rail is refused: the rotor swings about the commanded position, would close
//   the end switch on the way there, and be tripped for it. From MotorParams::swing before the end on it does not, as
//   long as it loses no step.
// - MOVE under the governor: pending until a certificate is found, too. Where a stop after the move, or the move
// itself,
//   leaves the cone it is refused. It is not bent.
// - HALT: a governed motion goes on until a certificate of the halt is found. Armed, the masses hold until then, while
//   the ball rolls.
// - A stop or a trip in tick k: from the start of tick k + 1 each mass stops by plan_stop() from its profile's
//   position, velocity and acceleration there, all in the time that the slowest needs at least (a mass that would be
//   stretched beyond an end of its rail takes its own shortest: lines end where the ball does, open splines at their
//   ends, both at their stops); then it holds. The acceleration has no jump, except where the motion itself has one
//   there, and near the step rate: an acceleration that would carry the speed past it begins lower. A motion that ends
//   by itself leaves the mode running.
// - Step overload: the tick's steps are made again with all masses stopping from the commanded state. A motor whose
//   stop cannot be stepped either holds. validate() refuses every motion that could lead there.
// - A tick repeated issues nothing: its steps are on their way already. A tick skipped, or one from the past, left the
//   motors without pulses; they stand, and hold there.
void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, StepCommand& steps);

// Predicts N and f_s along the last stop or move, a few steps per tick. The prediction starts from the attitude known
// in the tick that planned it and advances from the next tick on: while the masses stop, while they hold after a short
// stop, or while a move is pending. A new stop or move replaces it. A start drops it, because the motion takes its
// profiles' place; so does a start or a move that is refused for other reasons than the mode.
void predict(const ControllerParams& params, ControllerState& state);

// Measures the contact force by the IMU, where there is one with stated errors. Its flags are acted on in the next
// tick.
void measure(const ControllerParams& params, const Inputs& inputs, ControllerState& state);

// Writes the status, except overruns.
void report(const ControllerParams& params, const ControllerState& state, const Inputs& inputs,
            ControllerStatus& status);

}  // namespace ballast::firmware
