#include "tools/summary/required_friction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/program/short_number.h"

namespace ballast::sil {

namespace {

using program::short_number;
using program::short_time;

using Json = nlohmann::ordered_json;

// A cause below this part of the greatest one is not named.
constexpr double kWorthNaming = 0.5;

// Parts that exceed their sum by this factor nearly cancel, as where a ball is let go at rest. Then no load is named as
// the cause.
constexpr double kNearlyCancel = 100;

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

// The loads that contribute, or take away, at least half as much as the greatest.
std::string because(const std::vector<FrictionPart>& parts) {
  if (!parts.empty() && parts.front().part > kNearlyCancel) return ": what the masses ask for nearly cancels";
  std::vector<std::string> causes, remedies;
  for (const FrictionPart& part : parts) {
    if (std::abs(part.part) < kWorthNaming * parts.front().part) continue;
    (part.part > 0 ? causes : remedies).push_back(part.of + " (" + program::fixed_number(100 * part.part, 0) + " %)");
  }
  if (causes.empty()) return "";
  return " because of " + list(causes) + (remedies.empty() ? "" : " against " + list(remedies));
}

// Text for an unbounded f_s / N. Rounding leaves an f_s of 1e-15 of the weight where there is none.
std::string unbounded_text(const RunResult& result) {
  const double time_s = result.extrema.mu_required_max.time_s;
  if (!result.friction_shares) return fmt::format("N falls to 0 at {} s", short_time(time_s));
  const sim::ContactShares& shares = *result.friction_shares;
  if (shares.force_W_n.head<2>().norm() <= 1e-9 * std::abs(shares.static_weight_n))
    return fmt::format("leaves the ground at {} s on any floor", short_time(time_s));
  return fmt::format("needs more friction than any floor gives at {} s: N falls to 0", short_time(time_s));
}

// Prefix to statements about floors: a run that ended early says nothing of what would have come.
std::string up_to_its_end(const RunResult& result) {
  if (result.end_reason == EndReason::kCompleted) return "";
  std::string reason = to_string(result.end_reason);
  if (result.end_reason == EndReason::kTripped && result.trip.tripped == 0) reason += " by the controller";
  return fmt::format("up to its end at {} s ({}) ", short_time(result.final_sample.time_s), reason);
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
  if (!shares.floor.turning_W_n.isZero(0)) add("the floor's resistance", shares.floor);
  if (std::any_of(parts.begin(), parts.end(), [](const FrictionPart& p) { return !std::isfinite(p.part); })) return {};
  std::stable_sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.part > b.part; });
  return parts;
}

std::string friction_parts_text(const RunResult& result) {
  std::string text;
  for (const FrictionPart& p : friction_parts(result)) {
    const auto percent = [](double part) { return program::fixed_number(100 * part, 1); };
    text += fmt::format("  {:<18} {:>6} %: weight {}, own motion {}, carried round {}\n", p.of, percent(p.part),
                        percent(p.weight), percent(p.motion), percent(p.turning));
  }
  return text;
}

std::string required_friction_text(const RunResult& result, const std::vector<FloorVerdict>& floors) {
  const sim::Extremum& mu = result.extrema.mu_required_max;
  std::string text;
  const bool starts_rolling = result.regimes.front().regime == sim::Regime::kRolling;
  const char* unknown_floors = "does not start rolling, so other floors are not judged";
  if (mu.value == 0) {
    if (!starts_rolling) return unknown_floors;
    text = "needs no friction";
  } else if (std::isfinite(mu.value)) {
    text = (result.rolling_lost || result.end_reason != EndReason::kCompleted ? "needs at least " : "needs ") +
           fmt::format("{} at {} s", short_number(mu.value), short_time(mu.time_s));
    const auto slides = [](const sim::RegimeStart& start) { return start.regime == sim::Regime::kSliding; };
    if (!result.friction_shares && std::any_of(result.regimes.begin(), result.regimes.end(), slides))
      text += ", sliding";
  } else {
    text = unbounded_text(result);
  }
  text += because(friction_parts(result));
  if (!starts_rolling) return text + "; " + unknown_floors;
  text += "; " + up_to_its_end(result);
  std::vector<std::string> holds, fails;
  for (const FloorVerdict& floor : floors) (floor.holds ? holds : fails).emplace_back(floor.name);
  if (fails.empty()) return text + "rolls on all of the paper's floors";
  if (holds.empty()) {
    text += "rolls on none of the paper's floors";
    // The friction needed may lie below that of a floor on which rolling was lost earlier.
    const sim::Extremum& normal = result.extrema.normal_force_min;
    if (std::isfinite(mu.value) && normal.value <= 0)
      text += fmt::format(": N falls to 0 at {} s", short_time(normal.time_s));
    return text;
  }
  return text + "rolls on " + list(holds) + ", not on " + list(fails);
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
