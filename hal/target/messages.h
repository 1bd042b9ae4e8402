// The messages between a host and a microcontroller: payloads of the frames in frame.h.
//
// decode() accepts any bytes. It returns false unless they are exactly one message with every count, index, flag and
// enumeration in range. Physical values are not judged: NaN passes.
//
//   target                       host
//     Hello ------------------->         types and build are compared
//           <-------- Ball, Mass..., Reference..., Commit
//     Verdict ----------------->         accepted by firmware::validate(), and the same fingerprint on both ends
//           <------------------ World    tick k
//     Reply ------------------->         tick k; the pulses the pins gave during tick k - 1
//           ...
//     EndReport ---------------->         after the last tick; or, at any time, FaultReport
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <type_traits>

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/status.h"
#include "hal/host_link.h"
#include "hal/messages.h"
#include "hal/target/frame.h"

namespace ballast::hal::target {

// A text of at most N - 1 characters; longer ones are cut.
template <std::size_t N>
struct Text {
  std::array<char, N> characters{};
  Text() = default;
  Text(const char* text) {  // NOLINT(google-explicit-constructor): a text is a text
    for (std::size_t i = 0; i + 1 < N && text[i] != 0; ++i) characters[i] = text[i];
  }
  [[nodiscard]] const char* c_str() const { return characters.data(); }
};

// Sizes and sources that both ends compare before any other message.
struct Identity {
  std::uint64_t sources = 0;  // number of the firmware's sources (build_id.cmake)
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
  std::uint32_t counter_hz = 0;  // rate of every count the target reports
};

struct MassParams {
  firmware::Real mass_kg = 0;
  firmware::Rail rail;
  firmware::MotorParams motor;
  firmware::Wide initial_position = 0;  // of the motion, rail unit (rad or m)
  firmware::Wide initial_velocity = 0;  // per s
  std::int32_t piece_count = 0;
  std::array<firmware::ProfilePiece, firmware::kMaxPieces> pieces{};
};

// Consecutive values of firmware::ReferenceTable, as the bits of floats. Parts come in order.
inline constexpr int kReferencePart = 1024;
struct ReferencePart {
  std::int32_t count = 0;
  std::array<std::uint32_t, kReferencePart> bits{};
};

enum class Acceptance : std::uint8_t {
  kAccepted = 0,
  kRefused = 1,     // by firmware::validate()
  kIncomplete = 2,  // too few masses, or too many; or values of the reference are missing
  kMotion = 3,      // the pieces of a mass are no motion (Profile::set)
  kPeriod = 4,      // the board cannot keep the control period
};

// Ends the parameters.
struct Commit {
  std::uint32_t stretch = 1;  // factor by which the target's control ticks and pulse times are stretched
  bool play = true;           // false: the pulses are not given
};

struct Verdict {
  Acceptance acceptance = Acceptance::kAccepted;
  std::uint32_t fingerprint = 0;  // of the parameters as they stand in the target's memory
  Text<40> field;                 // the parameter that was refused; the rest is as in firmware::ParamError
  std::int32_t index = -1;
  std::int32_t piece = -1;
  firmware::Wide value = 0;
  firmware::Wide limit = 0;
  Text<80> allowed;
};

inline constexpr int kMaxCommands = 8;

// The controller's inputs of one tick.
struct World {
  bool last = false;  // the last tick of the run
  bool has_verdict = true;
  firmware::Sensors sensors;
  firmware::MonitorVerdict verdict;
  std::int32_t command_count = 0;
  std::array<firmware::OperatorInput, kMaxCommands> commands{};
};

// A step pulse as the step interrupt gave it.
struct PlayedPulse {
  std::uint32_t due_ticks = 0;    // commanded time, step timer ticks from the control tick's start
  std::uint16_t late_counts = 0;  // lateness; 65535 stands for any greater one, too
  std::uint8_t motor = 0;
  std::int8_t direction = 1;
};
inline constexpr int kMaxPulses = firmware::kMaxMasses * firmware::kMaxStepsPerTick;

struct PlayedPulses {
  std::int32_t count = 0;
  std::array<PlayedPulse, kMaxPulses> pulse{};
};

// The controller's outputs of one tick.
struct Reply {
  firmware::ControllerStatus status;
  firmware::StepCommand steps;
  std::uint32_t tick_counts = 0;  // time of the controller in this tick, counts
  PlayedPulses played;            // of the previous control tick
};

enum class Cause : std::uint8_t {
  kFault = 0,          // processor fault
  kStackOverflow = 1,  // access to the guard below the stack
  kWatchdog = 2,       // the tick did not return in time
  kLink = 3,           // bytes that are no frame, or a message out of turn
};

struct FaultReport {
  Cause cause = Cause::kFault;
  std::array<std::uint32_t, 13> r{};  // r0..r12
  std::uint32_t sp = 0, lr = 0, pc = 0, xpsr = 0;
  std::uint32_t cfsr = 0, hfsr = 0, mmfar = 0, bfar = 0;  // fault status and addresses, ARMv7-M B3.2.15
};

struct EndReport {
  Status status = Status::kEnded;
  LinkCounters counters;
  std::int64_t overruns = 0;  // late ticks, the last one included
  std::int64_t watchdog_kicks = 0;
  std::uint32_t stack_bytes = 0;       // reserved
  std::uint32_t stack_used_bytes = 0;  // written at least once
  PlayedPulses played;                 // of the last control tick
};

// A Reply whose parts lie elsewhere, as LinkBoard sends it.
struct ReplyView {
  ReplyView(const firmware::ControllerStatus& s, const firmware::StepCommand& c, std::uint32_t t, const PlayedPulses& p)
      : status(s), steps(c), tick_counts(t), played(p) {}
  const firmware::ControllerStatus& status;
  const firmware::StepCommand& steps;
  std::uint32_t tick_counts;
  const PlayedPulses& played;
};

// --- fields (hal/fields.h); those of the controller's messages are in hal/messages.h ---

template <class T>
inline constexpr bool kIsText = false;
template <std::size_t N>
inline constexpr bool kIsText<Text<N>> = true;
template <class V, class M>
requires kIsText<std::remove_const_t<M>>
constexpr decltype(auto) fields(V& visitor, M& m) {
  for (std::size_t i = 0; i + 1 < m.characters.size(); ++i) visitor.field(m.characters[i], Within(0, 127));
  return visitor.field(m.characters.back(), Within(0, 0));
}

template <class V, Of<Identity> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.sources, m.real_bytes, m.max_masses, m.max_pieces, m.max_rail_pieces, m.max_bursts,
                     m.max_steps_per_tick);
}

template <class V, Of<Hello> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.identity, m.board, m.counter_hz);
}

template <class V, Of<MassParams> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.mass_kg, Real())
      .all(m.rail, m.motor, m.initial_position, m.initial_velocity)
      .field(m.piece_count, Within(0, firmware::kMaxPieces))
      .field(m.pieces, first(m.piece_count));
}

template <class V, Of<ReferencePart> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.count, Within(1, kReferencePart)).field(m.bits, first(m.count));
}

template <class V, Of<Commit> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.stretch, Within(1, 1000)).field(m.play);
}

template <class V, Of<Verdict> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.acceptance, Within(Acceptance::kAccepted, Acceptance::kPeriod))
      .all(m.fingerprint, m.field, m.index, m.piece, m.value, m.limit, m.allowed);
}

template <class V, Of<World> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.last, m.has_verdict, m.sensors, m.verdict)
      .field(m.command_count, Within(0, kMaxCommands))
      .field(m.commands, first(m.command_count));
}

template <class V, Of<PlayedPulse> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.due_ticks, m.late_counts)
      .field(m.motor, Within(0, firmware::kMaxMasses - 1))
      .field(m.direction, Sign());
}

template <class V, Of<PlayedPulses> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.count, Within(0, kMaxPulses)).field(m.pulse, first(m.count));
}

template <class V, class M>
requires Of<M, Reply> || Of<M, ReplyView>
constexpr decltype(auto) fields(V& visitor, M& m) { return visitor.all(m.status, m.steps, m.tick_counts, m.played); }

template <class V, Of<FaultReport> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.cause, Within(Cause::kFault, Cause::kLink))
      .all(m.r, m.sp, m.lr, m.pc, m.xpsr, m.cfsr, m.hfsr, m.mmfar, m.bfar);
}

template <class V, Of<EndReport> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.status, Within(Status::kOk, Status::kIo))
      .all(m.counters, m.overruns, m.watchdog_kicks, m.stack_bytes, m.stack_used_bytes, m.played);
}

// --- messages ---

// The type of a message. A struct without one cannot be sent.
template <class M>
using Tag = std::type_identity<M>;
constexpr MessageType type_of(Tag<Hello>) { return MessageType::kHello; }
constexpr MessageType type_of(Tag<firmware::ControllerParams>) { return MessageType::kBall; }
constexpr MessageType type_of(Tag<MassParams>) { return MessageType::kMass; }
constexpr MessageType type_of(Tag<ReferencePart>) { return MessageType::kReference; }
constexpr MessageType type_of(Tag<Commit>) { return MessageType::kCommit; }
constexpr MessageType type_of(Tag<Verdict>) { return MessageType::kVerdict; }
constexpr MessageType type_of(Tag<World>) { return MessageType::kWorld; }
constexpr MessageType type_of(Tag<Reply>) { return MessageType::kReply; }
constexpr MessageType type_of(Tag<ReplyView>) { return MessageType::kReply; }
constexpr MessageType type_of(Tag<FaultReport>) { return MessageType::kFaultReport; }
constexpr MessageType type_of(Tag<EndReport>) { return MessageType::kEndReport; }

template <class M>
concept Message = requires {
  type_of(Tag<M>());
};

// Writes the whole frame and returns its size; 0: it does not fit.
template <Message M>
[[nodiscard]] std::size_t encode(const M& message, std::int64_t tick, std::span<std::uint8_t> bytes) {
  return encode_frame(bytes, type_of(Tag<M>()), tick, [&](Writer& writer) { visit(writer, message); });
}

// False: the frame holds another message, or not exactly one in range. `message` is then unusable.
template <Message M>
[[nodiscard]] bool decode(const Frame& frame, M& message) {
  if (frame.type != type_of(Tag<M>())) return false;
  Reader reader(frame.payload);
  visit(reader, message);
  return reader.complete();
}

// A checksum of all parameters the firmware computes with, as they are in memory, motions as they were built.
// `real_bytes` is 4 for the memory of a target with single precision.
[[nodiscard]] std::uint32_t fingerprint(const firmware::ControllerParams& params,
                                        std::uint8_t real_bytes = sizeof(firmware::Real));

// Values that a table of these parameters has; 0: there is none.
[[nodiscard]] int reference_values(const firmware::ControllerParams& params);

// The part of a table from `first` on, and its way back into the table. False: it has fewer values.
void get_reference(const firmware::ReferenceTable& table, int first, int end, ReferencePart& part);
[[nodiscard]] bool set_reference(const ReferencePart& part, int first, int end, firmware::ReferenceTable& table);

// Puts a mass's parameters in their place. False: its pieces are no motion (Profile::set).
[[nodiscard]] bool set_mass(const MassParams& mass, int index, firmware::ControllerParams& params);

}  // namespace ballast::hal::target
