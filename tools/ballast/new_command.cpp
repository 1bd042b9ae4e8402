// ballast new: writes a first robot with a task, after a few questions.
#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string_view>

#include "sim/motors/motor_presets.h"
#include "sim/scenario/scenario.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"

namespace ballast {
namespace {

struct NewCommand {
  std::string name;
  bool yes = false;
};

// One question, with the answer that Enter or --yes gives.
struct Question {
  const char* text;
  double low, high, answer;
};

constexpr std::size_t kLongestName = 64;  // that a scenario may have

constexpr double kShellThickness = 0.01;  // of the radius: the inertia is that of a hollow sphere

// False: three answers were out of range, which is printed. Where the input ends, the usual answer counts.
bool ask(Question& question) {
  for (int attempt = 0; attempt < 3; ++attempt) {
    fmt::print("{} [{:g}]: ", question.text, question.answer);
    std::fflush(stdout);
    std::string line;
    if (!std::getline(std::cin, line)) fmt::print("\n");
    if (line.empty()) return true;
    double value = 0;
    if (CLI::detail::lexical_cast(line, value) && value >= question.low && value <= question.high) {
      question.answer = value;
      return true;
    }
    fmt::print("  {}: allowed: a number from {:g} to {:g}\n", line, question.low, question.high);
  }
  program::complain("ballast", "three answers were out of range; nothing is written");
  return false;
}

// A motor that the masses can carry, geared so that it lifts its mass with a part of its torque.
struct Drive {
  const char* preset;
  double gear_ratio, viscous_damping_nms;
};

// `speed`: that the masses reach on their rings, in rad/s.
Drive drive_for(double mass_kg, double ring_m, double speed) {
  constexpr double kLiftingPart = 0.19, kMovingPart = 0.4;  // of the holding torque: to lift, and to move and lift
  constexpr double kDampingOfTorque = 0.06;                 // s: swings die away, and little torque is lost
  const char* const name = mass_kg < 0.25 ? "nema11" : mass_kg < 0.7 ? "nema17" : "nema23";
  const double holding_nm = sim::find_motor_preset(name)->holding_torque_nm;
  const double load_nm = mass_kg * 9.81 * ring_m;
  const double ratio = std::max(4.0, std::ceil(load_nm / (kLiftingPart * holding_nm)));
  const double most = (kMovingPart * holding_nm - load_nm / ratio) / (ratio * speed);
  return {name, ratio, std::min(kDampingOfTorque * holding_nm, most)};
}

std::string ring(double mass_kg, double radius_m, const Drive& drive, const std::string& center,
                 const std::string& forward, const char* what) {
  return fmt::format(R"(
[[mass]]  # {}
mass = {:.4g}
rail = {{ shape = "circle", radius = {:.4g}, center = {}, axes = [[0, 0, -1], {}] }}
[mass.motor]
preset = "{}"
gear_ratio = {:.1f}
viscous_damping = {:.2g}  # N m s: carriage and drive; damps the motor's swing
)",
                     what, mass_kg, radius_m, center, forward, drive.preset, drive.gear_ratio,
                     drive.viscous_damping_nms);
}

std::string robot_text(const std::string& name, double radius_m, double shell_kg, double mass_kg, double friction,
                       double distance_m) {
  const double inside = (1 - kShellThickness) * radius_m, inertia = 2.0 / 3 * shell_kg * inside * inside;
  const double ring_m = 0.63 * radius_m, apart_m = 0.4 * radius_m, steer_m = 0.33 * radius_m;
  // Slow enough to need little friction, and several rocking periods of the ball.
  const double duration_s = std::max(6.0, 12 * distance_m);
  std::string text = fmt::format(
      R"(# A ball that two masses drive and one steers, each on a ring inside the shell. At theta = 0 every mass hangs at the bottom
# of its ring, so that the ball rests upright. `ballast plan {0}.toml` finds the motion.
name = "{0}"
gravity = 9.81
duration = {6:g}

[ball]
radius = {1:g}
mass = {2:g}
inertia = [{3:.4g}, {3:.4g}, {3:.4g}]  # a hollow sphere

[surface]
static_friction = {4:g}

[run]
actuation = "stepper"

[task]
goal = [{5:g}, 0.0]
duration = {6:g}
at_rest = true
)",
      name, radius_m, shell_kg, inertia, friction, distance_m, duration_s);
  const auto beside = [&](double y_m) { return fmt::format("[0, {:.4g}, 0]", y_m); };
  // The ball turns fastest halfway, at up to twice its mean rate; masses on rings turn a little less.
  const Drive drive = drive_for(mass_kg, ring_m, 1.7 * distance_m / (duration_s * radius_m));
  text += ring(mass_kg, ring_m, drive, beside(-apart_m), "[1, 0, 0]", "drives");
  text += ring(mass_kg, ring_m, drive, beside(apart_m), "[1, 0, 0]", "drives");
  text += ring(mass_kg, steer_m, drive, fmt::format("[0, 0, {:.4g}]", 0.2 * radius_m), "[0, 1, 0]", "steers");
  return text;
}

// Empty, or why no robot of this name is written.
std::string name_refusal(const NewCommand& command) {
  const std::string file = command.name + ".toml";
  if (std::filesystem::exists(file)) return file + ": exists; allowed: the name of a new robot";
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.'; };
  const bool usable = command.name.size() <= kLongestName && command.name.front() != '.' &&
                      std::all_of(command.name.begin(), command.name.end(), good);
  return usable ? "" : "NAME: " + command.name + " cannot name a robot; allowed: 1 to 64 of letters, digits, - _ .";
}

int write_robot(const NewCommand& command) {
  if (const std::string why = name_refusal(command); !why.empty()) return refuse(why);
  Question radius{"Radius of the ball in m", 0.05, 1, 0.15};
  Question shell{"Mass of shell and everything fixed to it in kg", 0.05, 50, 0.8};
  Question mass{"Mass of each of the three moving masses in kg", 0.02, 20, 0.28};
  Question friction{"Static friction coefficient of the floor", 0.05, 1.5, 0.5};
  Question distance{"How far it is to roll in m", 0.05, 5, 0.5};
  for (Question* question : {&radius, &shell, &mass, &friction, &distance}) {
    if (!command.yes && !ask(*question)) return program::kExitUsage;
  }
  const std::string text =
      robot_text(command.name, radius.answer, shell.answer, mass.answer, friction.answer, distance.answer);
  const std::string file = command.name + ".toml";
  if (const auto read = sim::parse_scenario(text, file); !read.ok()) {
    program::complain("ballast", to_string(read.errors.front()));
    return program::kExitUsage;
  }
  std::ofstream stream(file);
  stream << text;
  stream.close();
  if (!stream) {
    program::complain("ballast", fmt::format("{}: cannot be written", file));
    return program::kExitCouldNotRun;
  }
  const std::string ballast = program::ballast_as_typed();
  std::cout << fmt::format("written: {0}\nplan its motion:  {1} plan {0}\nrun it:           {1} run {2}_plan.toml\n",
                           file, ballast, command.name)
            << std::flush;
  return program::kExitCompleted;
}

}  // namespace

std::function<int()> add_new_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("new", "Writes a first robot with a task, after a few questions");
  auto options = std::make_shared<NewCommand>();
  command->add_option("NAME", options->name, "name of the robot; the file is NAME.toml here")
      ->required()
      ->check(program::not_empty());
  command->add_flag("--yes", options->yes, "asks nothing and takes the usual answers");
  return [options] {
    constexpr std::string_view kEnding = ".toml";
    if (options->name.size() > kEnding.size() && options->name.ends_with(kEnding))
      options->name.resize(options->name.size() - kEnding.size());
    return write_robot(*options);
  };
}

}  // namespace ballast
