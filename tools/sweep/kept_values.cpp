#include "tools/sweep/kept_values.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sim/scenario/reader.h"
#include "tools/summary/summary_tree.h"
#include "tools/sweep/summary_schema.h"

namespace ballast::sweep {
namespace {

using Json = nlohmann::json;

// Values that a controller with feedback will report. Runs without one have none.
constexpr const char* kOfFeedback[] = {"tracking", "governor"};

// One value that the plant decides.
struct PlantValue {
  const char* name;
  Cell (*of)(const sim::Scenario& scenario, const sil::RunResult& result);
};

Cell numbers(const double* begin, std::size_t count) { return std::vector<double>(begin, begin + count); }

constexpr PlantValue kPlantValues[] = {
    {"end.reason", [](const auto&, const auto& r) -> Cell { return std::string(to_string(r.end_reason)); }},
    {"end.time", [](const auto&, const auto& r) -> Cell { return r.final_sample.time_s; }},
    {"surface.static_friction", [](const auto& s, const auto&) -> Cell { return s.surface.static_friction; }},
    {"mu_required.max", [](const auto&, const auto& r) -> Cell { return r.extrema.mu_required_max.value; }},
    {"mu_required.time", [](const auto&, const auto& r) -> Cell { return r.extrema.mu_required_max.time_s; }},
    {"normal_force.min", [](const auto&, const auto& r) -> Cell { return r.extrema.normal_force_min.value; }},
    {"normal_force.min_time", [](const auto&, const auto& r) -> Cell { return r.extrema.normal_force_min.time_s; }},
    {"normal_force.max", [](const auto&, const auto& r) -> Cell { return r.extrema.normal_force_max.value; }},
    {"normal_force.max_time", [](const auto&, const auto& r) -> Cell { return r.extrema.normal_force_max.time_s; }},
    {"static_friction.max", [](const auto&, const auto& r) -> Cell { return r.extrema.static_friction_max.value; }},
    {"static_friction.time", [](const auto&, const auto& r) -> Cell { return r.extrema.static_friction_max.time_s; }},
    {"final.mass_position",
     [](const auto& s, const auto& r) { return numbers(r.final_sample.mass_position.data(), s.masses.size()); }},
    {"final.mass_velocity",
     [](const auto& s, const auto& r) { return numbers(r.final_sample.mass_velocity.data(), s.masses.size()); }},
    {"final.orientation", [](const auto&, const auto& r) { return numbers(r.final_sample.orientation.data(), 4); }},
    {"final.angular_velocity",
     [](const auto&, const auto& r) { return numbers(r.final_sample.angular_velocity_B_radps.data(), 3); }},
    {"final.position", [](const auto&, const auto& r) { return numbers(r.final_sample.position_W_m.data(), 3); }},
    {"final.velocity", [](const auto&, const auto& r) { return numbers(r.final_sample.velocity_W_mps.data(), 3); }},
    {"travel.position", [](const auto&, const auto& r) { return numbers(r.final_sample.position_W_m.data(), 3); }},
    {"travel.speed", [](const auto&, const auto& r) -> Cell { return r.final_sample.velocity_W_mps.norm(); }},
};

const PlantValue* plant_value(const std::string& name) {
  const auto found = std::find_if(std::begin(kPlantValues), std::end(kPlantValues),
                                  [&](const PlantValue& v) { return v.name == name; });
  return found == std::end(kPlantValues) ? nullptr : found;
}

std::vector<std::string> parts_of(const std::string& name) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t dot = std::min(name.find('.', begin), name.size());
    parts.push_back(name.substr(begin, dot - begin));
    begin = dot + 1;
  }
  return parts;
}

bool of_feedback(const std::vector<std::string>& parts) {
  return parts.size() == 2 &&
         std::find(std::begin(kOfFeedback), std::end(kOfFeedback), parts[0]) != std::end(kOfFeedback);
}

bool is_index(const std::string& part) {
  return !part.empty() && part.size() < 6 &&
         std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
}

const Json& schema() {
  static const Json parsed = Json::parse(kSummarySchema);
  return parsed;
}

const Json& followed(const Json& node) {
  return node.contains("$ref") ? schema().at(Json::json_pointer(node.at("$ref").get<std::string>().substr(1))) : node;
}

// Adds the names of all values below a node of the schema, the entries of a list as 0.
void add_names(const Json& given, const std::string& path, std::vector<std::string>& names) {
  const Json& node = followed(given);
  if (node.contains("properties")) {
    for (const auto& [key, value] : node.at("properties").items())
      add_names(value, path.empty() ? key : path + "." + key, names);
  } else if (node.contains("items") && followed(node.at("items")).contains("properties")) {
    add_names(node.at("items"), path + ".0", names);
  } else {
    names.push_back(path);
  }
}

// The node of the schema for a name; nullptr: none.
const Json* schema_of(const std::vector<std::string>& parts) {
  const Json* node = &schema();
  for (const std::string& part : parts) {
    node = &followed(*node);
    if (node->contains("properties") && node->at("properties").contains(part))
      node = &node->at("properties").at(part);
    else if (node->contains("items") && is_index(part))
      node = &node->at("items");
    else
      return nullptr;
  }
  return &followed(*node);
}

Cell cell_of(const nlohmann::ordered_json& value) {
  if (value.is_number()) return value.get<double>();
  if (value.is_boolean()) return value.get<bool>() ? 1.0 : 0.0;
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_array()) return {};
  std::vector<double> list;
  for (const auto& item : value) list.push_back(item.is_number() ? item.get<double>() : std::nan(""));
  return list;
}

Cell summary_value(const nlohmann::ordered_json& summary, const std::string& name) {
  const nlohmann::ordered_json* node = &summary;
  for (const std::string& part : parts_of(name)) {
    if (node->is_object() && node->contains(part))
      node = &node->at(part);
    else if (node->is_array() && is_index(part) && std::stoul(part) < node->size())
      node = &node->at(std::stoul(part));
    else
      return {};
  }
  return cell_of(*node);
}

}  // namespace

std::string unknown_value(const std::string& name) {
  const std::vector<std::string> parts = parts_of(name);
  if (of_feedback(parts)) return "";
  if (parts[0] == "wall_time" || parts[0] == "speed")
    return "differs between identical runs; allowed: any other value in summary.json";
  const Json* node = schema_of(parts);
  if (node == nullptr) {
    std::vector<std::string> names;
    add_names(schema(), "", names);
    const std::string near = sim::nearest(name, names);
    return "is no value in summary.json" + (near.empty() ? "" : fmt::format(" (did you mean {}?)", near)) +
           "; allowed: one of its names, dotted, such as mu_required.max";
  }
  if (node->contains("properties"))
    return "is a table in summary.json; allowed: one of its values, such as " + name + "." +
           node->at("properties").begin().key();
  if (node->contains("items") && followed(node->at("items")).contains("properties"))
    return "is a list of tables in summary.json; allowed: a value of one entry, such as " + name + ".0." +
           followed(node->at("items")).at("properties").begin().key();
  return "";
}

std::vector<Cell> kept_values(std::span<const std::string> names, const sim::Scenario& scenario,
                              const sil::RunResult& result) {
  std::vector<Cell> cells;
  cells.reserve(names.size());
  nlohmann::ordered_json summary;
  for (const std::string& name : names) {
    if (const PlantValue* value = plant_value(name)) {
      cells.push_back(value->of(scenario, result));
      continue;
    }
    if (summary.is_null()) summary = sil::summary_tree(scenario, result);
    cells.push_back(summary_value(summary, name));
  }
  return cells;
}

std::vector<Cell> kept_plant_values(std::span<const std::string> names, const sim::Scenario& scenario,
                                    const sil::RunResult& result) {
  std::vector<Cell> cells;
  cells.reserve(names.size());
  for (const std::string& name : names) {
    const PlantValue* value = plant_value(name);
    cells.push_back(value == nullptr ? Cell() : value->of(scenario, result));
  }
  return cells;
}

bool decided_by_plant(std::span<const std::string> names, bool has_plan) {
  return std::all_of(names.begin(), names.end(), [&](const std::string& name) {
    return plant_value(name) != nullptr || (!has_plan && of_feedback(parts_of(name)));
  });
}

}  // namespace ballast::sweep
