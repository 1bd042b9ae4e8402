// Every chain of fields (hal/fields.h) visits every byte of its struct once.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "hal/target/messages.h"

namespace ballast::hal::target {
namespace {

// A visitor that notes where the fields lie.
class Places : public Visitor<Places> {
 public:
  template <class Name, class T, class Rule>
  void leaf(const Name&, const T& value, const Rule& rule) {
    if constexpr (std::is_same_v<Rule, Within>) {
      EXPECT_TRUE(static_cast<std::int64_t>(value) >= rule.low && static_cast<std::int64_t>(value) <= rule.high);
    }
    add(value);
  }

  // Adds a member that the chain does not visit.
  template <class T>
  void add(const T& value) {
    places_.push_back({reinterpret_cast<std::uintptr_t>(&value), sizeof value, alignof(T)});
  }

  // Expects that no more than padding lies between the fields of `whole`, which then counts as one field.
  template <class T>
  void expect_all_of(const T& whole) {
    const auto begin = reinterpret_cast<std::uintptr_t>(&whole);
    const auto outside = [&](const Place& p) { return p.begin < begin || p.begin >= begin + sizeof whole; };
    std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) { return a.begin < b.begin; });
    auto at = begin;
    for (const Place& place : places_) {
      if (outside(place)) continue;
      ASSERT_GE(place.begin, at) << "byte " << place.begin - begin << " is visited twice";
      ASSERT_LT(place.begin - at, place.alignment) << "no field visits byte " << at - begin;
      at = place.begin + place.size;
    }
    ASSERT_LT(begin + sizeof whole - at, alignof(T)) << "no field visits byte " << at - begin;
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
  visit(places, status);
  places.add(status.predicted.angular_acceleration_B_radps2);  // both Unsent
  places.add(status.predicted.friction_force_W_n);
  places.expect_all_of(status.measured);
  places.expect_all_of(status.governor);
  places.expect_all_of(status.halt);
  places.expect_all_of(status);
}

TEST(TargetFields, OfTheSteps) {
  firmware::StepCommand steps;
  steps.motor_count = firmware::kMaxMasses;
  steps.burst_count = firmware::kMaxBursts;
  for (auto& burst : steps.bursts) burst.count = 1;
  Places places;
  visit(places, steps);
  places.add(steps.last_pulse);  // Unsent
  places.expect_all_of(steps);
}

TEST(TargetFields, OfWhatTheControllerHears) {
  World world;
  Places places;
  visit(places, world);
  places.add(world.commands);
  places.expect_all_of(world.sensors);
  places.expect_all_of(world.verdict);
  places.expect_all_of(world);
  firmware::OperatorInput command = firmware::MoveRequest{};
  Places of_command;
  visit(of_command, command);
  of_command.expect_all_of(command.move);
  of_command.add(command.course);  // there with its own command only
  of_command.expect_all_of(command);
  firmware::CoursePart part;
  part.count = firmware::kCoursePart;
  firmware::OperatorInput go = part;
  Places of_go;
  visit(of_go, go);
  of_go.expect_all_of(go.course);
}

TEST(TargetFields, OfTheParameters) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  Places places;
  visit(places, *params);
  for (std::size_t i = 0; i < firmware::kMaxMasses; ++i) {
    places.add(params->ball.mass_kg[i]);  // these four travel in MassParams
    params->ball.rail[i].shape = firmware::RailShape::kSpline;
    params->ball.rail[i].piece_count = firmware::kMaxRailPieces;
    visit(places, params->ball.rail[i]);
    visit(places, params->motor[i]);
    places.add(params->motion[i]);  // built on the target from its pieces
  }
  places.add(params->tracking.values);  // travel in ReferencePart
  places.expect_all_of(params->tracking);
  places.expect_all_of(params->governor);
  places.expect_all_of(*params);
  const auto mass = std::make_unique<MassParams>();
  mass->rail.shape = firmware::RailShape::kSpline;
  mass->rail.piece_count = firmware::kMaxRailPieces;
  mass->piece_count = firmware::kMaxPieces;
  Places of_mass;
  visit(of_mass, *mass);
  of_mass.expect_all_of(*mass);
  const auto part = std::make_unique<ReferencePart>();
  part->count = kReferencePart;
  Places of_part;
  visit(of_part, *part);
  of_part.expect_all_of(*part);
}

// A member too small to show among the bytes is counted: visit() compiles only if the chain names every member. These
// chains name too few, or too many.
struct Forgetful {
  bool first = false, second = false;
};
struct Repetitive {
  bool first = false;
};
struct Sound {
  bool first = false, second = false;
};
template <class V, Of<Forgetful> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.first);
}
template <class V, Of<Repetitive> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.first).field(m.first);
}
template <class V, Of<Sound> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.first).field(m.second, Unsent());
}
static_assert(!is_whole<Forgetful>());
static_assert(!is_whole<Repetitive>());
static_assert(is_whole<Sound>());

// A type without a MessageType cannot be sent or received, whether it has a chain of fields or not.
template <class M>
concept Sendable = requires(M& m, const Frame& frame, std::span<std::uint8_t> bytes) {
  encode(m, 0, bytes);
  decode(frame, m);
};
static_assert(Sendable<World> && Sendable<Reply>);
static_assert(!Sendable<Sound> && !Sendable<firmware::StepCommand> && !Sendable<int>);

// The range of the refusals covers the enumeration.
TEST(TargetFields, EveryRefusalTravels) {
  const auto sent = std::make_unique<Reply>(), received = std::make_unique<Reply>();
  for (int reason = 0; reason <= static_cast<int>(firmware::Refusal::kCancelled); ++reason) {
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
