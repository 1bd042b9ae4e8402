// ballast faults: lists the kinds of faults for --fault and [[fault]].
#include <fmt/core.h>

#include <cmath>
#include <iostream>
#include <string>

#include "sim/scenario/fault.h"
#include "sim/scenario/reader.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"

namespace ballast {

namespace {

constexpr char kPeersInProcesses[] =
    "  With --processes these are signals, and the run waits for the peer. A peer that is frozen or slow for less\n"
    "  than --peer-timeout is not detected (exit status 0). Otherwise, or killed, it ends the run (2, not 3).\n";

std::string value_text(const sim::FaultKindInfo& kind) {
  if (kind.value_means[0] == '\0') return "none";
  std::string text = kind.value_means;
  const auto allowed = [&] {
    if (std::isinf(kind.low)) return std::string();
    const std::string low = sim::number_text(kind.low);
    if (std::isinf(kind.high)) return std::string(kind.low_excluded ? "> " : ">= ") + low;
    return low + (kind.low_excluded ? " < .. " : " .. ") + sim::number_text(kind.high);
  }();
  if (!allowed.empty()) text += ", " + allowed;
  if (kind.unit[0] != '\0') text += fmt::format(", {}", kind.unit);
  return text + (kind.value_default ? "; default " + sim::number_text(*kind.value_default) : "; required");
}

std::string lasts_text(const sim::FaultKindInfo& kind) {
  if (kind.lasts_s == sim::kAnInstant) return "once";
  if (kind.lasts_s == sim::kOnePeriod) return "duration; default one control period";
  if (std::isinf(kind.lasts_s)) return "duration; default to the end";
  return "duration; default " + sim::number_text(kind.lasts_s) + " s";
}

const char* target_text(const sim::FaultKindInfo& kind) {
  switch (kind.layer) {
    case sim::FaultLayer::kMessage:
      return "channel (default BALLAST_SENSORS), peer that receives it (default all)";
    case sim::FaultLayer::kPeer:
      return "peer: controller (default) or monitor";
    case sim::FaultLayer::kSensor:
      return "sensor: gyro (default), accelerometer, orientation, limit_switch; axis 0, 1, 2 (default all); with such "
             "a "
             "sensor in\n[sensors] encoder, of mass (default all), and position_fix, axis 0 or 1";
    case sim::FaultLayer::kMotor:
      return "mass, counted from 0 (default 0)";
    case sim::FaultLayer::kWorld:
      return "push: direction, space frame (default [1, 0, 0])";
    case sim::FaultLayer::kProgram:
      return "none";
  }
  return "";
}

}  // namespace

std::function<int()> add_faults_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("faults", "Lists the faults that --fault KIND@TIME[:PARAM] can inject");
  return [] {
    std::cout
        << "--fault KIND@TIME[:PARAM], TIME in s; PARAM: the value, or KEY=VALUE, or several, separated by commas:\n"
           "  --fault sensor_bias@2:0.1,sensor=gyro,axis=1 --fault motor_stall@1.5:mass=2,duration=0.1\n"
           "In a scenario: [[fault]] with kind, time, value and the same keys.\n";
    const sim::FaultLayer* before = nullptr;
    for (const sim::FaultKindInfo& kind : sim::fault_kinds()) {
      if (before == nullptr || *before != kind.layer) {
        std::cout << fmt::format("\n{}; on: {}\n", to_string(kind.layer), target_text(kind));
        if (kind.layer == sim::FaultLayer::kPeer) std::cout << kPeersInProcesses;
        before = &kind.layer;
      }
      std::cout << fmt::format("  {:<20} {}\n", kind.name, kind.what);
      if (kind.value_means[0] != '\0') std::cout << fmt::format("  {:20} value: {}\n", "", value_text(kind));
      std::cout << fmt::format("  {:20} lasts: {}\n", "", lasts_text(kind));
      std::cout << fmt::format("  {:20} detected by: {}\n", "", kind.detected_by);
    }
    return program::kExitCompleted;
  };
}

}  // namespace ballast
