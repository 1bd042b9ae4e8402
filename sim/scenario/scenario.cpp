#include "sim/scenario/scenario.h"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "sim/scenario/check.h"
#include "sim/scenario/fingerprint.h"
#include "sim/scenario/plausibility.h"
#include "sim/scenario/read_fault.h"

namespace ballast::sim {
namespace {

constexpr std::size_t kMaxFileSize = 1 << 22;  // bytes; bounds the reading of a device or a log given by mistake

// Reads the file into `text`. Returns the error, empty if there is none.
std::string read_file(const std::filesystem::path& file, std::string& text) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found)
    return "no such file, and no scenario of that name ships; allowed: a TOML file";
  if (!std::filesystem::exists(status)) return "cannot be read: " + error.message() + "; allowed: a readable TOML file";
  if (std::filesystem::is_directory(status)) return "is a directory; allowed: a TOML file";
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return std::string("cannot be read: ") + std::strerror(errno) + "; allowed: a readable TOML file";
  std::string chunk(1 << 16, '\0');
  while (stream.read(chunk.data(), static_cast<std::streamsize>(chunk.size())) || stream.gcount() > 0) {
    text.append(chunk, 0, static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMaxFileSize) return "is too large for a scenario; allowed: a TOML file of at most 4 MiB";
  }
  return stream.bad() ? "cannot be read; allowed: a readable TOML file" : "";
}

// Replaces control characters: a quoted key may contain escape sequences and line ends.
std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= ' ' && byte != 0x7f) {
      out += c;
    } else {
      constexpr char kHex[] = "0123456789abcdef";
      out += {'\\', 'x', kHex[byte >> 4], kHex[byte & 15]};
    }
  }
  return out;
}

// The scenario as TOML. It gets the name that came from the file, and the kinetic friction that --set lowered
// (check.cpp). Published numbers of another robot are left out.
std::string file_text(Node& root, const Scenario& scenario) {
  if (root.find("name") == nullptr) {
    Node name;
    name.kind = NodeKind::kString;
    name.text = scenario.name;
    root.entries.emplace_back("name", std::move(name));
  }
  Node* surface = root.find("surface");
  Node* kinetic = surface == nullptr ? nullptr : surface->find("kinetic_friction");
  if (kinetic != nullptr && kinetic->number != scenario.surface.kinetic_friction) {
    kinetic->kind = NodeKind::kFloat;
    kinetic->number = scenario.surface.kinetic_friction;
  }
  if (scenario.published.empty()) {
    std::erase_if(root.entries, [](const auto& entry) { return entry.first == "published"; });
  }
  return to_toml(root) + "\n";
}

}  // namespace

std::string to_string(const ScenarioError& error) {
  std::string text = error.source;
  if (error.line > 0) text += fmt::format(":{}", error.line);
  if (!error.key.empty()) text += ": " + error.key;
  if (!error.value.empty()) text += (error.key.empty() ? ": " : " = ") + error.value;
  return printable(text + ": " + error.message);
}

Scenario as_believed(Scenario scenario) {
  if (!scenario.believed) return scenario;
  const World believed = std::move(*scenario.believed);
  scenario.believed.reset();
  static_cast<World&>(scenario) = believed;
  return scenario;
}

Scenario::operator PlantModel() const {
  PlantModel model{*this, run.actuation, run.on_violation, duration_s, run.control_period_s, run.tolerance, seed,
                   {},    false};
  // A governed start may be another than the motion's.
  model.begins_held = run.actuation == Actuation::kIdeal && control.governor;
  for (const Fault& fault : faults) {
    if (const auto kind = plant_fault_kind(fault.kind)) {
      const auto mass = static_cast<std::size_t>(fault.mass);
      model.faults.push_back({*kind, fault.time_s, fault.end_s, fault.value, mass, fault.direction_W});
    }
  }
  return model;
}

ScenarioResult parse_scenario(std::string_view toml, std::string_view source_name,
                              const std::vector<std::string>& overrides, const std::vector<std::string>& faults) {
  ScenarioResult result;
  Node root;
  if (!read_tree(toml, source_name, root, result.errors)) return result;
  for (const std::string& assignment : overrides) apply_override(assignment, root, result.errors);
  for (const std::string& fault : faults) add_fault(fault, root, result.errors);
  ReadContext context{std::string(source_name), result.errors, result.warnings};
  result.scenario = check_scenario(root, context);
  if (result.ok()) warn_of_implausible_values(root, context.source_name, result.scenario, result.warnings);
  // Errors stand in the order of the file; those without a line come first.
  for (auto* found : {&result.errors, &result.warnings}) {
    std::stable_sort(found->begin(), found->end(),
                     [](const ScenarioError& a, const ScenarioError& b) { return a.line < b.line; });
  }
  // Published numbers belong to the robot of the file, however it is run.
  const auto changes_robot = [](const std::string& o) { return !o.starts_with("run.") && !o.starts_with("seed="); };
  if (std::any_of(overrides.begin(), overrides.end(), changes_robot) || !result.scenario.faults.empty()) {
    result.scenario.published.clear();
  }
  if (!result.ok()) return result;
  result.scenario.id = fingerprint(result.scenario);
  result.scenario.toml = file_text(root, result.scenario);
  return result;
}

ScenarioResult read_scenario(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                             const std::vector<std::string>& faults) {
  std::string text;
  const std::string error = read_file(file, text);
  if (!error.empty()) {
    ScenarioResult result;
    result.errors.push_back({file.string(), 0, "", "", error});
    return result;
  }
  return parse_scenario(text, file.string(), overrides, faults);
}

std::filesystem::path find_scenario(const std::string& name_or_path, const std::filesystem::path& shipped_dir) {
  std::error_code error;
  const std::filesystem::path path(name_or_path);
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  // A directory with the name of a scenario, such as its results, does not hide the scenario.
  if (std::filesystem::exists(status) && !std::filesystem::is_directory(status)) return path;
  if (!name_or_path.empty() && path.filename() == path) {
    const std::filesystem::path shipped = shipped_dir / (name_or_path + ".toml");
    if (std::filesystem::is_regular_file(shipped, error)) return shipped;
  }
  // read_scenario() reports why a path cannot be read.
  return status.type() == std::filesystem::file_type::not_found ? std::filesystem::path{} : path;
}

}  // namespace ballast::sim
