// What host and microcontroller say to each other; the payloads of frame.h. A message is described once, by fields(),
// for both directions and both ends. decode() takes any bytes: false, and the message unusable, unless they are exactly
// one message with every count, index, flag and enumeration in range. Physical values are not judged: NaN passes.
//
//   target                       host
//     Hello ------------------->         types and build are compared
//           <-------- Ball, Mass..., Commit
//     Verdict ----------------->         accepted by firmware::validate(), and the same fingerprint on both ends
//           <------------------ World    tick k
//     Reply ------------------->         tick k; the pulses the pins gave during tick k - 1
//           ...
//     Farewell ---------------->         after the last tick; or, at any time, LastWords
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "firmware/control/controller.h"
#include "hal/host_link.h"
#include "hal/target/frame.h"

namespace ballast::hal::target {

// A text of at most N - 1 characters.
template <std::size_t N>
struct Text {
  std::array<char, N> characters{};
  Text() = default;
  Text(const char* text) {  // NOLINT(google-explicit-constructor): a text is a text
    for (std::size_t i = 0; i + 1 < N && text[i] != 0; ++i) characters[i] = text[i];
  }
  [[nodiscard]] const char* c_str() const { return characters.data(); }
};

// What both ends must agree on before anything is sent that depends on it.
struct Identity {
  std::uint64_t sources = 0;  // of everything that decides what the firmware computes and says
  std::uint8_t real_bytes = sizeof(firmware::Real);
  std::int32_t max_masses = firmware::kMaxMasses;
  std::int32_t max_pieces = firmware::kMaxPieces;
  std::int32_t max_rail_pieces = firmware::kMaxRailPieces;
  std::int32_t max_bursts = firmware::kMaxBursts;
  std::int32_t max_steps_per_tick = firmware::kMaxStepsPerTick;
};

struct Hello {
  Identity identity;
  Text<32> board;
  std::uint32_t counter_hz = 0;  // of all counts reported
};

struct MassParams {
  firmware::Real mass_kg = 0;
  firmware::Rail rail;
  firmware::MotorParams motor;
  firmware::Wide initial_position = 0;  // of the motion
  firmware::Wide initial_velocity = 0;
  std::int32_t piece_count = 0;
  std::array<firmware::ProfilePiece, firmware::kMaxPieces> pieces{};
};

enum class Acceptance : std::uint8_t {
  kAccepted = 0,
  kRefused = 1,     // by firmware::validate()
  kIncomplete = 2,  // masses are missing, or there are too many
  kMotion = 3,      // a mass's motion is no motion
  kPeriod = 4,      // this board cannot keep the control period
};

// After the last mass.
struct Commit {
  std::uint32_t stretch = 1;  // the target's control ticks and pulses take this many times as long
  bool play = true;           // false: the pulses are not given
};

struct Verdict {
  Acceptance acceptance = Acceptance::kAccepted;
  std::uint32_t fingerprint = 0;  // of the parameters as they stand in the target's memory
  Text<40> field;                 // of what was refused
  std::int32_t index = -1;
  std::int32_t piece = -1;
  firmware::Wide value = 0;
  firmware::Wide limit = 0;
  Text<80> allowed;
};

inline constexpr int kMaxCommands = 8;

struct World {
  bool last = false;  // no tick comes after this one
  bool has_verdict = true;
  firmware::Sensors sensors;
  firmware::MonitorVerdict verdict;
  std::int32_t command_count = 0;
  std::array<firmware::OperatorInput, kMaxCommands> commands{};
};

// A step pulse as the step interrupt gave it.
struct PlayedPulse {
  std::uint32_t due_ticks = 0;    // of the step timer, from the control tick's start: as commanded
  std::uint16_t late_counts = 0;  // after that; 65535: so much or more
  std::uint8_t motor = 0;
  std::int8_t direction = 1;
};
inline constexpr int kMaxPulses = firmware::kMaxMasses * firmware::kMaxStepsPerTick;

struct PlayedPulses {
  std::int32_t count = 0;
  std::array<PlayedPulse, kMaxPulses> pulse{};
};

struct Reply {
  firmware::ControllerStatus status;
  firmware::StepCommand steps;
  std::uint32_t tick_counts = 0;  // from the inputs' arrival to the steps
  PlayedPulses played;            // during the control tick before this one
};

enum class Cause : std::uint8_t {
  kFault = 0,          // the processor took a fault
  kStackOverflow = 1,  // it ran into the guard below the stack
  kWatchdog = 2,       // the tick did not come back
  kLink = 3,           // bytes that are no frame came, or a message out of turn
};

struct LastWords {
  Cause cause = Cause::kFault;
  std::array<std::uint32_t, 13> r{};  // r0..r12
  std::uint32_t sp = 0, lr = 0, pc = 0, xpsr = 0;
  std::uint32_t cfsr = 0, hfsr = 0, mmfar = 0, bfar = 0;  // fault status and addresses, ARMv7-M B3.2.15
};

struct Farewell {
  Status status = Status::kEnded;
  LinkCounters counters;
  std::int64_t overruns = 0;  // late ticks, the last one too
  std::int64_t watchdog_kicks = 0;
  std::uint32_t stack_bytes = 0;       // reserved
  std::uint32_t stack_used_bytes = 0;  // ever written
  PlayedPulses played;                 // during the last control tick
};

// --- fields ---

template <class A, class V>
void vector_fields(A& archive, V& vector) {
  for (int j = 0; j < vector.size(); ++j) archive.real(vector[j]);
}

template <class A, class T>
void text_fields(A& archive, T& text) {
  const auto* last = &text.characters.back();
  for (auto& character : text.characters) archive.bounded(character, 0, &character == last ? 0 : 127);
}

// One pattern for all that follows: M is the message, or const when it is written.
template <class A, class M>
void identity_fields(A& archive, M& m) {
  archive(m.sources);
  archive(m.real_bytes);
  archive(m.max_masses);
  archive(m.max_pieces);
  archive(m.max_rail_pieces);
  archive(m.max_bursts);
  archive(m.max_steps_per_tick);
}

template <class A, class M>
void hello_fields(A& archive, M& m) {
  identity_fields(archive, m.identity);
  text_fields(archive, m.board);
  archive(m.counter_hz);
}

// ControllerParams without what belongs to a mass.
template <class A, class M>
void ball_fields(A& archive, M& m) {
  archive(m.scenario_id);
  archive(m.control_period_s);
  archive(m.timer_frequency_hz);
  archive.real(m.static_friction);
  archive(m.sensor_stale_ticks);
  archive(m.monitor_stale_ticks);
  archive.real(m.ball.radius_m);
  archive.real(m.ball.gravity_mps2);
  archive.real(m.ball.shell_mass_kg);
  vector_fields(archive, m.ball.inertia_kgm2);
  vector_fields(archive, m.ball.center_of_mass_B_m);
  vector_fields(archive, m.ball.external_force_W_n);
  archive.bounded(m.ball.mass_count, 0, firmware::kMaxMasses);
}

template <class A, class M>
void rail_fields(A& archive, M& m) {
  archive.bounded(m.shape, 0, static_cast<int>(firmware::RailShape::kSpline));
  vector_fields(archive, m.origin_B_m);
  vector_fields(archive, m.axis_cos_B);
  vector_fields(archive, m.axis_sin_B);
  archive.real(m.radius_m);
  archive.real(m.lower_end);
  archive.real(m.upper_end);
  archive(m.closed);
  archive.bounded(m.piece_count, 0, firmware::kMaxRailPieces);
  archive.real(m.piece_length_m);
  if (!archive.ok() || m.shape != firmware::RailShape::kSpline) return;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(m.piece_count) && archive.ok(); ++k) {
    vector_fields(archive, m.knots[k].position_B_m);
    vector_fields(archive, m.knots[k].d2_B_per_m);
  }
}

template <class A, class M>
void motor_fields(A& archive, M& m) {
  archive(m.steps_per_unit);
  archive(m.max_step_rate_hz);
  archive(m.max_acceleration);
  archive(m.max_jerk);
  archive(m.direction_setup_s);
  archive(m.swing);
}

template <class A, class M>
void mass_fields(A& archive, M& m) {
  archive.real(m.mass_kg);
  rail_fields(archive, m.rail);
  motor_fields(archive, m.motor);
  archive(m.initial_position);
  archive(m.initial_velocity);
  archive.bounded(m.piece_count, 0, firmware::kMaxPieces);
  for (std::size_t k = 0; archive.ok() && k < static_cast<std::size_t>(m.piece_count); ++k) {
    archive(m.pieces[k].duration_s);
    archive(m.pieces[k].acceleration_start);
    archive(m.pieces[k].acceleration_end);
  }
}

template <class A, class M>
void commit_fields(A& archive, M& m) {
  archive.bounded(m.stretch, 1, 1000);
  archive(m.play);
}

template <class A, class M>
void verdict_fields(A& archive, M& m) {
  archive.bounded(m.acceptance, 0, static_cast<int>(Acceptance::kPeriod));
  archive(m.fingerprint);
  text_fields(archive, m.field);
  archive(m.index);
  archive(m.piece);
  archive(m.value);
  archive(m.limit);
  text_fields(archive, m.allowed);
}

template <class A, class M>
void command_fields(A& archive, M& m) {
  archive.bounded(m.command, 1, static_cast<int>(firmware::OperatorCommand::kMove));
  if (!archive.ok() || m.command != firmware::OperatorCommand::kMove) return;
  archive(m.move.masses);
  for (auto& target : m.move.target_position) archive(target);
  archive(m.move.speed_fraction);
}

template <class A, class M>
void world_fields(A& archive, M& m) {
  archive(m.last);
  archive(m.has_verdict);
  archive(m.sensors.tick);
  vector_fields(archive, m.sensors.orientation.coeffs());
  vector_fields(archive, m.sensors.gyro_B_radps);
  vector_fields(archive, m.sensors.accelerometer_B_mps2);
  for (auto& bits : m.sensors.limit_switch) archive.bounded(bits, 0, 3);
  archive(m.verdict.tick);
  archive(m.verdict.tripped);
  archive.bounded(m.command_count, 0, kMaxCommands);
  for (std::size_t i = 0; archive.ok() && i < static_cast<std::size_t>(m.command_count); ++i) {
    command_fields(archive, m.commands[i]);
  }
}

template <class A, class M>
void steps_fields(A& archive, M& m) {
  archive(m.tick);
  archive.bounded(m.motor_count, 0, firmware::kMaxMasses);
  for (std::size_t i = 0; archive.ok() && i < static_cast<std::size_t>(m.motor_count); ++i) {
    archive(m.steps[i]);
    archive(m.position_steps[i]);
  }
  archive.bounded(m.burst_count, 0, firmware::kMaxBursts);
  for (std::size_t i = 0; archive.ok() && i < static_cast<std::size_t>(m.burst_count); ++i) {
    archive.bounded(m.bursts[i].motor, 0, m.motor_count - 1);
    archive.sign(m.bursts[i].direction);
    archive.bounded(m.bursts[i].count, 1, 32767);
    archive.bounded(m.bursts[i].first_ticks, 0, 0x7fffffff);
    archive.bounded(m.bursts[i].interval_ticks, 0, 0x7fffffff);
    archive(m.bursts[i].add_ticks);
  }
}

template <class A, class M>
void status_fields(A& archive, M& m) {
  archive(m.tick);
  archive(m.scenario_id);
  archive.bounded(m.mode, 0, static_cast<int>(firmware::Mode::kMoving));
  archive(m.at_rest);
  archive(m.faults);
  archive.bounded(m.motor_count, 0, firmware::kMaxMasses);
  for (std::size_t i = 0; archive.ok() && i < static_cast<std::size_t>(m.motor_count); ++i) {
    archive.real(m.commanded_position[i]);
    archive.real(m.commanded_velocity[i]);
    archive(m.next[i].position);
    archive(m.next[i].velocity);
    archive(m.next[i].acceleration);
    archive(m.steps_issued[i]);
  }
  archive.real(m.predicted.normal_force_n);
  archive.real(m.predicted.static_friction_n);
  archive.real(m.mu_required);
  archive.real(m.margin);
  archive(m.overruns);
  archive(m.operator_commands);
  archive.bounded(m.overload.trouble.error, 0, static_cast<int>(firmware::StepError::kTooFast));
  archive(m.overload.trouble.value);
  archive(m.overload.trouble.limit);
  archive.bounded(m.overload.motor, -1, firmware::kMaxMasses - 1);
  archive(m.overload.tick);
  archive.bounded(m.refusal.reason, 0, static_cast<int>(firmware::Refusal::kUpperEnd));
  archive.bounded(m.refusal.motor, -1, 31);
  archive.bounded(m.refusal.piece, -1, firmware::kMaxPieces);
  archive(m.refusal.value);
  archive(m.planned);
  archive(m.plan_tick);
  archive(m.plan.duration_s);
  archive(m.plan.horizon_s);
  archive.real(m.plan.normal_force_min_n);
  archive.real(m.plan.mu_required_max);
  archive.real(m.plan.margin_min);
}

template <class A, class M>
void played_fields(A& archive, M& m) {
  archive.bounded(m.count, 0, kMaxPulses);
  for (std::size_t i = 0; archive.ok() && i < static_cast<std::size_t>(m.count); ++i) {
    archive(m.pulse[i].due_ticks);
    archive(m.pulse[i].late_counts);
    archive.bounded(m.pulse[i].motor, 0, firmware::kMaxMasses - 1);
    archive.sign(m.pulse[i].direction);
  }
}

template <class A, class S, class C, class P, class N>
void reply_fields(A& archive, S& status, C& steps, N& tick_counts, P& played) {
  status_fields(archive, status);
  steps_fields(archive, steps);
  archive(tick_counts);
  played_fields(archive, played);
}

template <class A, class M>
void last_words_fields(A& archive, M& m) {
  archive.bounded(m.cause, 0, static_cast<int>(Cause::kLink));
  for (auto& value : m.r) archive(value);
  archive(m.sp);
  archive(m.lr);
  archive(m.pc);
  archive(m.xpsr);
  archive(m.cfsr);
  archive(m.hfsr);
  archive(m.mmfar);
  archive(m.bfar);
}

template <class A, class M>
void farewell_fields(A& archive, M& m) {
  archive.bounded(m.status, 0, static_cast<int>(Status::kIo));
  archive(m.counters.malformed);
  archive(m.counters.repeated);
  archive(m.counters.out_of_order);
  archive(m.counters.foreign);
  archive(m.counters.dropped);
  archive(m.overruns);
  archive(m.watchdog_kicks);
  archive(m.stack_bytes);
  archive(m.stack_used_bytes);
  played_fields(archive, m.played);
}

// --- which message is which ---

template <class A, class M>
void fields(A& archive, M& m) {
  using T = std::remove_const_t<M>;
  if constexpr (std::is_same_v<T, Hello>) hello_fields(archive, m);
  if constexpr (std::is_same_v<T, firmware::ControllerParams>) ball_fields(archive, m);
  if constexpr (std::is_same_v<T, MassParams>) mass_fields(archive, m);
  if constexpr (std::is_same_v<T, Commit>) commit_fields(archive, m);
  if constexpr (std::is_same_v<T, Verdict>) verdict_fields(archive, m);
  if constexpr (std::is_same_v<T, World>) world_fields(archive, m);
  if constexpr (std::is_same_v<T, Reply>) reply_fields(archive, m.status, m.steps, m.tick_counts, m.played);
  if constexpr (std::is_same_v<T, LastWords>) last_words_fields(archive, m);
  if constexpr (std::is_same_v<T, Farewell>) farewell_fields(archive, m);
}

template <class M>
inline constexpr MessageType kTypeOf = MessageType{};
template <>
inline constexpr MessageType kTypeOf<Hello> = MessageType::kHello;
template <>
inline constexpr MessageType kTypeOf<firmware::ControllerParams> = MessageType::kBall;
template <>
inline constexpr MessageType kTypeOf<MassParams> = MessageType::kMass;
template <>
inline constexpr MessageType kTypeOf<Commit> = MessageType::kCommit;
template <>
inline constexpr MessageType kTypeOf<Verdict> = MessageType::kVerdict;
template <>
inline constexpr MessageType kTypeOf<World> = MessageType::kWorld;
template <>
inline constexpr MessageType kTypeOf<Reply> = MessageType::kReply;
template <>
inline constexpr MessageType kTypeOf<LastWords> = MessageType::kLastWords;
template <>
inline constexpr MessageType kTypeOf<Farewell> = MessageType::kFarewell;

// 0: it does not fit.
template <class M>
[[nodiscard]] std::size_t encode(const M& message, std::int64_t tick, std::span<std::uint8_t> bytes) {
  return encode_frame(bytes, kTypeOf<M>, tick, [&](Writer& writer) { fields(writer, message); });
}

// False: another message, or not one in range. `message` is then to be thrown away.
template <class M>
[[nodiscard]] bool decode(const Frame& frame, M& message) {
  if (frame.type != kTypeOf<M>) return false;
  Reader reader(frame.payload);
  fields(reader, message);
  return reader.complete();
}

// Of all that decides what the firmware computes, taken from the parameters as they are in memory, motions as they were
// built. `real_bytes` 4: as they are in the memory of a target with single precision.
[[nodiscard]] std::uint32_t fingerprint(const firmware::ControllerParams& params,
                                        std::uint8_t real_bytes = sizeof(firmware::Real));

// Puts a mass's parameters in their place. False: its motion is no motion.
[[nodiscard]] bool set_mass(const MassParams& mass, int index, firmware::ControllerParams& params);

}  // namespace ballast::hal::target
