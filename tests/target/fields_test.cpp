// Nothing of what host and firmware say to each other is left behind: the functions of messages.h are handed every
// field there is.
#include <gtest/gtest.h>

#include <memory>

#include "hal/target/messages.h"

namespace ballast::hal::target {
namespace {

// An archive that notes where the fields it is handed lie.
class Places {
 public:
  template <class T>
  void operator()(const T& value) {
    add(value);
  }
  template <class T>
  void real(const T& value) {
    add(value);
  }
  template <class T>
  void sign(const T& value) {
    add(value);
  }
  template <class T>
  void bounded(const T& value, std::int64_t low, std::int64_t high) {
    EXPECT_TRUE(static_cast<std::int64_t>(value) >= low && static_cast<std::int64_t>(value) <= high);
    add(value);
  }
  [[nodiscard]] bool ok() const { return true; }

  // For what has its reason not to travel, and for what others look after.
  template <class T>
  void add(const T& value) {
    places_.push_back({reinterpret_cast<std::uintptr_t>(&value), sizeof value, alignof(T)});
  }

  // Between the fields of `whole` there is no more than padding; from then on it counts as one.
  template <class T>
  void expect_all_of(const T& whole) {
    const auto begin = reinterpret_cast<std::uintptr_t>(&whole);
    const auto outside = [&](const Place& p) { return p.begin < begin || p.begin >= begin + sizeof whole; };
    std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) { return a.begin < b.begin; });
    auto at = begin;
    for (const Place& place : places_) {
      if (outside(place)) continue;
      ASSERT_GE(place.begin, at) << "byte " << place.begin - begin << " travels twice";
      ASSERT_LT(place.begin - at, place.alignment) << "nobody carries what is at byte " << at - begin;
      at = place.begin + place.size;
    }
    ASSERT_LT(begin + sizeof whole - at, alignof(T)) << "nobody carries what is at byte " << at - begin;
    std::erase_if(places_, [&](const Place& p) { return !outside(p); });
    add(whole);
  }

 private:
  struct Place {
    std::uintptr_t begin;
    std::size_t size, alignment;
  };
  std::vector<Place> places_;
};

TEST(TargetFields, OfTheStatus) {
  firmware::ControllerStatus status;
  status.motor_count = firmware::kMaxMasses;
  Places places;
  status_fields(places, status);
  places.add(status.predicted.angular_acceleration_B_radps2);  // these two: for the firmware's own use
  places.add(status.predicted.friction_force_W_n);
  places.expect_all_of(status);
}

TEST(TargetFields, OfTheSteps) {
  firmware::StepCommand steps;
  steps.motor_count = firmware::kMaxMasses;
  steps.burst_count = firmware::kMaxBursts;
  for (auto& burst : steps.bursts) burst.count = 1;
  Places places;
  steps_fields(places, steps);
  places.add(steps.last_pulse);  // for the firmware's next command
  places.expect_all_of(steps);
}

TEST(TargetFields, OfWhatTheControllerHears) {
  World world;
  Places places;
  world_fields(places, world);
  places.add(world.commands);
  places.expect_all_of(world.sensors);
  places.expect_all_of(world.verdict);
  places.expect_all_of(world);
  firmware::OperatorInput command = firmware::MoveRequest{};
  Places of_command;
  command_fields(of_command, command);
  of_command.expect_all_of(command.move);
  of_command.expect_all_of(command);
}

TEST(TargetFields, OfTheParameters) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  Places places;
  ball_fields(places, *params);
  for (std::size_t i = 0; i < firmware::kMaxMasses; ++i) {
    places.real(params->ball.mass_kg[i]);  // these four: mass_fields
    params->ball.rail[i].shape = firmware::RailShape::kSpline;
    params->ball.rail[i].piece_count = firmware::kMaxRailPieces;
    rail_fields(places, params->ball.rail[i]);
    motor_fields(places, params->motor[i]);
    places.add(params->motion[i]);  // built over there, from pieces, and part of the fingerprint
  }
  places.expect_all_of(*params);
  const auto mass = std::make_unique<MassParams>();
  mass->rail.shape = firmware::RailShape::kSpline;
  mass->rail.piece_count = firmware::kMaxRailPieces;
  mass->piece_count = firmware::kMaxPieces;
  Places of_mass;
  mass_fields(of_mass, *mass);
  of_mass.expect_all_of(*mass);
}

// A small field could hide in padding, so they are counted: whoever adds one has to come by here.
struct Anything {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor): it is to be taken for any field
};
template <class T, class... Taken>
consteval int fields_in() {
  if constexpr (requires { T{Taken{}..., Anything{}}; }) {
    return fields_in<T, Taken..., Anything>();
  } else {
    return sizeof...(Taken);
  }
}
static_assert(fields_in<firmware::ControllerStatus>() == 20, "status_fields()");
static_assert(fields_in<firmware::StepOverload>() == 3, "status_fields()");
static_assert(fields_in<firmware::StepTrouble>() == 3, "status_fields()");
static_assert(fields_in<firmware::RefusalReport>() == 4, "status_fields()");
static_assert(fields_in<firmware::Prediction>() == 5, "status_fields()");
static_assert(fields_in<firmware::ProfilePoint>() == 3, "status_fields()");
static_assert(fields_in<firmware::StepCommand>() == 7, "steps_fields()");
static_assert(fields_in<firmware::StepBurst>() == 6, "steps_fields()");
static_assert(fields_in<firmware::Sensors>() == 5, "world_fields()");
static_assert(fields_in<firmware::MonitorVerdict>() == 2, "world_fields()");
static_assert(fields_in<firmware::MoveRequest>() == 3, "command_fields()");
static_assert(fields_in<firmware::ControllerParams>() == 9, "ball_fields()");
static_assert(fields_in<firmware::BallParams>() == 9, "ball_fields()");
static_assert(fields_in<firmware::Rail>() == 11, "rail_fields()");
static_assert(fields_in<firmware::MotorParams>() == 6, "motor_fields()");

// The last of each enumeration is in range.
TEST(TargetFields, EveryRefusalTravels) {
  const auto sent = std::make_unique<Reply>(), received = std::make_unique<Reply>();
  for (int reason = 0; reason <= static_cast<int>(firmware::Refusal::kUpperEnd); ++reason) {
    sent->status.refusal.reason = static_cast<firmware::Refusal>(reason);
    std::vector<std::uint8_t> bytes(kMaxFrame);
    bytes.resize(encode(*sent, 0, bytes));
    Frame frame;
    ASSERT_EQ(decode_frame(bytes, frame).error, FrameError::kNone);
    ASSERT_TRUE(decode(frame, *received)) << reason;
    EXPECT_EQ(received->status.refusal.reason, sent->status.refusal.reason);
  }
}

}  // namespace
}  // namespace ballast::hal::target
