// Damaged scenario texts: every one is either accepted whole or refused with reasons; none gets anywhere else.
#include <cmath>
#include <random>

#include "tests/random_seed.h"
#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

constexpr int kTexts = 600;

std::string mutated(std::string text, std::mt19937& random) {
  static const std::vector<std::string> kTokens = {"nan",
                                                   "-inf",
                                                   "1e308",
                                                   "-1e-308",
                                                   "1e15",
                                                   "-1e15",
                                                   "1e-15",
                                                   "1e300",
                                                   "1e-300",
                                                   "0",
                                                   "-1",
                                                   "9223372036854775807",
                                                   "99999999999999999999",
                                                   "\"",
                                                   "'''",
                                                   "[",
                                                   "]",
                                                   "{",
                                                   "}",
                                                   "[[mass]]\n",
                                                   "[mass]\n",
                                                   "[ball]\n",
                                                   "=",
                                                   ".",
                                                   ",",
                                                   "\n",
                                                   "#",
                                                   std::string(1, '\0'),
                                                   "\xff",
                                                   "\xc3\xa9",
                                                   "true",
                                                   "\"spline\"",
                                                   "\"line\"",
                                                   "\"circle\"",
                                                   "1979-05-27",
                                                   "mass = 1\n",
                                                   "rail = 3\n",
                                                   "motion = [ [ ] ]\n",
                                                   std::string(300, '[')};
  constexpr std::size_t kNumbers = 13;  // the first of the tokens
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  const int edits = 1 + static_cast<int>(below(4));
  for (int i = 0; i < edits; ++i) {
    const std::size_t at = below(text.size() + 1);
    const std::size_t length = std::min<std::size_t>(below(24), text.size() - at);
    switch (below(6)) {
      case 0:
        text.erase(at, length);
        break;
      case 1:
        text.insert(at, kTokens[below(kTokens.size())]);
        break;
      case 2:
        text.insert(below(text.size() + 1), text.substr(at, length));
        break;
      case 3:
        if (at < text.size()) text[at] = static_cast<char>(random());
        break;
      case 4: {  // a number becomes another token
        const std::size_t digit = text.find_first_of("0123456789", at);
        if (digit == std::string::npos) break;
        const std::size_t end = text.find_first_not_of("0123456789.e-", digit);
        text.replace(digit, (end == std::string::npos ? text.size() : end) - digit, kTokens[below(kNumbers)]);
        break;
      }
      default: {  // a line goes
        const std::size_t start = text.rfind('\n', at) == std::string::npos ? 0 : text.rfind('\n', at);
        const std::size_t end = text.find('\n', start + 1);
        text.erase(start, end == std::string::npos ? end : end - start);
      }
    }
  }
  return text;
}

TEST(Mutations, AreAcceptedWholeOrRefusedWithReasons) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(20180701));
  std::mt19937 random(seed);
  int accepted_count = 0, refused_count = 0, syntax_count = 0;
  for (int i = 0; i < kTexts; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", text " + std::to_string(i));
    const std::string text = mutated(i % 2 == 0 ? kFull : kPaths, random);
    const ScenarioResult result = parse(text);
    for (const ScenarioError& error : result.errors) {
      EXPECT_FALSE(error.message.empty());
      EXPECT_EQ(error.source, "test.toml");
      EXPECT_GE(error.line, 0);
      EXPECT_FALSE(to_string(error).empty());
    }
    if (!result.ok()) {
      ++refused_count;
      syntax_count += result.errors.front().message.rfind("not TOML", 0) == 0;
      continue;
    }
    ++accepted_count;
    const Scenario& s = result.scenario;
    EXPECT_NE(s.id, 0);
    EXPECT_EQ(parse(text).scenario.id, s.id);
    EXPECT_TRUE(s.duration_s > 0 && std::isfinite(s.duration_s));
    EXPECT_TRUE(s.ball.inertia_kgm2.allFinite() && s.ball.center_of_mass_B_m.norm() < s.ball.radius_m);
    EXPECT_LE(s.masses.size(), 8u);
    for (const Mass& mass : s.masses) {
      EXPECT_GT(mass.mass_kg, 0);
      const Eigen::Vector3d start = firmware::evaluate(mass.rail, mass.initial_position).position;
      EXPECT_LE(start.norm(), s.ball.radius_m * (1 + 1e-11));  // the allowance of 1e-12, and rounding of the evaluation
      for (const Eigen::Vector3d& point : mass.trajectory.points_B_m) {
        EXPECT_LE(point.norm(), s.ball.radius_m * (1 + 1e-11));
      }
      if (!mass.trajectory.times_s.empty()) continue;  // no motor
      EXPECT_TRUE(std::isfinite(mass.motor.holding_torque_nm) && mass.motor.holding_torque_nm > 0);
      EXPECT_TRUE(std::isfinite(mass.motor.shaft_ratio) && mass.motor.shaft_ratio > 0);
      const Motor& m = mass.motor;
      for (const double number : {m.rotor_inertia_kgm2, m.detent_torque_nm, m.viscous_damping_nms, m.max_step_rate_hz,
                                  m.max_acceleration, m.max_jerk, mass.end_stops.stiffness_npm}) {
        EXPECT_TRUE(number >= 0 && number <= 1e15) << number;
      }
    }
  }
  // The damage must neither be too little nor too much to reach past TOML's syntax.
  EXPECT_GT(accepted_count, kTexts / 50);
  EXPECT_GT(syntax_count, kTexts / 20);
  EXPECT_GT(refused_count - syntax_count, kTexts / 20);
}

std::string times(std::size_t n, const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < n; ++i) out += text;
  return out;
}

// A parser that takes keys apart recursively would come to the stack's end.
TEST(Hostile, KeysOfAMillionPartsAreRefused) {
  const std::string parts = times(1'000'000, ".a");
  for (const std::string& text :
       {"\n\na" + parts + " = 1\n", "# a\n\n[a" + parts + "]\n", "\n\n\"a\"" + times(1'000'000, " . 'a'") + " = 1\n",
        "x = \"\\\"\"\n\ny = { z = 1, a" + parts + " = 1 }\n"}) {
    const ScenarioError error = only_error(text);
    EXPECT_TRUE(contains(error.message, "has a key of more than 16 parts"));
    EXPECT_EQ(error.line, 3);
  }
  const ScenarioError error = only_error(kFull, {"gravity={a" + parts + "=1}"});
  EXPECT_EQ(error.key, "gravity");
  EXPECT_TRUE(contains(error.message, "a string"));
}

TEST(Hostile, DotsInTextsAndCommentsAreNoParts) {
  const std::string dots = times(40, ".");
  for (const std::string& text : {"x = \"" + dots + "\"", "x = '" + dots + "'", "x = \"\\\"" + dots + "\"",
                                  "x = \"\"\"\n\"" + dots + "\n\"\"\"\"\"", "x = '''\n''" + dots + "'''''",
                                  "x = 1 # " + dots, "x = [" + times(40, "0.5, ") + "]", times(40, "x.y = 0.5\n")}) {
    for (const ScenarioError& error : parse(text + "\n").errors) {
      EXPECT_FALSE(contains(error.message, "parts")) << text;
    }
  }
}

TEST(Hostile, ValuesNestedWithoutEndAreRefused) {
  for (const char* opening : {"[", "{a=", "[{a="}) {
    const ScenarioError error = only_error("\nx = " + times(100'000, opening) + "\n");
    EXPECT_TRUE(contains(error.message, "not TOML"));
    EXPECT_EQ(error.line, 2);
  }
}

// Where each of its values is, is found without counting through the line: with that, this would take minutes.
TEST(Hostile, ALineMayBeTheWholeFile) {
  const ScenarioError error = only_error(kFull + "\n[x]\ny = [" + times(300'000, "'\u00fc', ") + "'']\n");
  EXPECT_EQ(error.key, "x");
  EXPECT_TRUE(contains(error.message, "unknown key"));
}

TEST(Hostile, KeysDoNotSpeakToTheTerminal) {
  const std::string text = to_string(only_error("\"\\u001b[2J\\n\" = 1\n" + kFull));
  EXPECT_TRUE(contains(text, ": \\x1b[2J\\x0a = 1: unknown key"));
}

}  // namespace
}  // namespace ballast::sim
