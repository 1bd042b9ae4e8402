#include "tools/sil/required_friction.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace ballast::sil {

namespace {

using Json = nlohmann::ordered_json;

// Less than this part of what the greatest cause does is not named beside it.
constexpr double kWorthNaming = 0.5;

std::string number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

// Whoever does at least half of what the greatest does, and who takes as much of it away.
std::string because(const std::vector<FrictionPart>& parts) {
  std::vector<std::string> causes, remedies;
  for (const FrictionPart& part : parts) {
    if (std::abs(part.part) < kWorthNaming * parts.front().part) continue;
    (part.part > 0 ? causes : remedies).push_back(part.of + number(" (%.0f %%)", 100 * part.part));
  }
  if (causes.empty()) return "";
  return " because of " + list(causes) + (remedies.empty() ? "" : " against " + list(remedies));
}

}  // namespace

std::vector<FrictionPart> friction_parts(const RunResult& result) {
  std::vector<FrictionPart> parts;
  if (!result.friction_shares || !(result.extrema.mu_required_max.value > 0)) return parts;
  const sim::ContactShares& shares = *result.friction_shares;
  const auto add = [&](std::string of, const sim::LoadShare& load) {
    parts.push_back({std::move(of), part_of_friction(shares, load),
                     part_of_friction(shares, load.weight_W_n, load.static_weight_n),
                     part_of_friction(shares, load.motion_W_n, 0), part_of_friction(shares, load.turning_W_n, 0)});
  };
  for (int i = 0; i < shares.mass_count; ++i)
    add("mass " + std::to_string(i), shares.mass[static_cast<std::size_t>(i)]);
  add("the ball", shares.shell);
  if (!shares.outside.weight_W_n.isZero(0)) add("the outside force", shares.outside);
  if (std::any_of(parts.begin(), parts.end(), [](const FrictionPart& p) { return !std::isfinite(p.part); })) return {};
  std::stable_sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.part > b.part; });
  return parts;
}

std::string friction_parts_text(const RunResult& result) {
  std::string text;
  for (const FrictionPart& p : friction_parts(result)) {
    char line[128];
    std::snprintf(line, sizeof line, "  %-18s %6.1f %%: weight %.1f, own motion %.1f, carried round %.1f\n",
                  p.of.c_str(), 100 * p.part, 100 * p.weight, 100 * p.motion, 100 * p.turning);
    text += line;
  }
  return text;
}

std::string required_friction_text(const RunResult& result, const std::vector<FloorVerdict>& floors) {
  const sim::Extremum& mu = result.extrema.mu_required_max;
  std::string text;
  if (mu.value == 0) {
    text = "needs no friction";
  } else if (std::isfinite(mu.value)) {
    text = (result.rolling_lost ? "needs at least " : "needs ") + number("%.3g at ", mu.value) +
           number("%.2f s", mu.time_s);
    if (!result.friction_shares) text += ", sliding";
  } else {
    text = number("leaves the ground at %.2f s on any floor", mu.time_s);
  }
  text += because(friction_parts(result));
  std::vector<std::string> holds, fails;
  for (const FloorVerdict& floor : floors) (floor.holds ? holds : fails).emplace_back(floor.name);
  if (fails.empty()) return text + "; holds on all of the paper's floors";
  if (holds.empty()) return text + "; holds on none of the paper's floors";
  return text + "; holds on " + list(holds) + ", not on " + list(fails);
}

Json required_friction_json(const RunResult& result, const std::vector<FloorVerdict>& floors) {
  Json json;
  json["text"] = required_friction_text(result, floors);
  if (result.friction_shares) {
    const Eigen::Vector3d& force_W_n = result.friction_shares->force_W_n;
    json["normal_force"] = force_W_n[2];
    json["static_friction"] = force_W_n.head<2>().norm();
  } else {
    json["normal_force"] = json["static_friction"] = nullptr;
  }
  json["parts"] = Json::array();
  for (const FrictionPart& part : friction_parts(result)) {
    json["parts"].push_back({{"of", part.of},
                             {"part", part.part},
                             {"weight", part.weight},
                             {"motion", part.motion},
                             {"turning", part.turning}});
  }
  return json;
}

}  // namespace ballast::sil
