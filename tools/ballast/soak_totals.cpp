#include "tools/ballast/soak_totals.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

namespace ballast {
namespace {

using Json = nlohmann::ordered_json;

// The counts by their names in the file.
template <class Totals, class Visit>
void for_each_count(Totals& totals, const Visit& visit) {
  visit("seeds", totals.seeds);
  visit("broken", totals.broken);
  visit("faults", totals.faults);
  visit("with_faults", totals.faulty);
  visit("left_the_envelope", totals.violated);
  visit("simulated_us", totals.simulated_us);
  visit("ticks", totals.ticks);
  visit("refused", totals.refused);
  for (std::size_t i = 0; i < totals.outcomes.size(); ++i)
    visit(to_string(static_cast<soak::Outcome>(i)), totals.outcomes[i]);
}

}  // namespace

void SoakTotals::add(const soak::SeedResult& result) {
  ++seeds;
  broken += result.broken >= 0;
  faults += static_cast<std::uint64_t>(result.faults);
  faulty += result.faults > 0;
  violated += result.violated;
  simulated_us += result.simulated_us;
  ticks += result.ticks;
  refused += result.refused;
  ++outcomes[static_cast<std::size_t>(result.outcome)];
}

void SoakTotals::add(const SoakTotals& other) {
  seeds += other.seeds;
  broken += other.broken;
  faults += other.faults;
  faulty += other.faulty;
  violated += other.violated;
  simulated_us += other.simulated_us;
  ticks += other.ticks;
  refused += other.refused;
  for (std::size_t i = 0; i < outcomes.size(); ++i) outcomes[i] += other.outcomes[i];
  wall_s += other.wall_s;
}

std::string SoakTotals::text() const {
  const auto part = [&](std::uint64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(seeds);
  };
  std::string text;
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (outcomes[i] == 0) continue;
    text += fmt::format("  {:<30} {:5.1f} %\n", to_string(static_cast<soak::Outcome>(i)), part(outcomes[i]));
  }
  text += fmt::format("  {:<30} {:5.1f} %\n", "left the envelope", part(violated));
  text += fmt::format("  {:<30} {:5.1f} %, {} faults\n", "with faults", part(faulty), faults);
  text += fmt::format("  {:<30} {} of the scenarios drawn\n", "refused by the check", refused);
  const double simulated_h = 1e-6 * static_cast<double>(simulated_us) / 3600;
  return text + fmt::format("{} seed{}, {:.2f} h simulated in {} ticks, {:.4g} s, {:.3g} seeds/s, {} broken\n", seeds,
                            seeds == 1 ? "" : "s", simulated_h, ticks, wall_s, static_cast<double>(seeds) / wall_s,
                            broken);
}

std::string read_soak_file(const std::filesystem::path& path, const std::string& build, const SeedRange& range,
                           SoakFile& out) {
  out = {build, {}, {}};
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return "";
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  try {
    const Json file = Json::parse(text.str());
    out.build = file.at("build").get<std::string>();
    for (const Json& seeds : file.at("ranges"))
      out.ranges.push_back({seeds.at(0).get<std::uint64_t>(), seeds.at(1).get<std::uint64_t>()});
    const Json& totals = file.at("totals");
    for_each_count(out.totals, [&](const char* name, auto& count) { totals.at(name).get_to(count); });
    totals.at("wall_s").get_to(out.totals.wall_s);
  } catch (const Json::exception&) {
    return "is no file of this command; allowed: one that it has written, or a new name";
  }
  if (out.build != build) {
    return fmt::format("has seeds of another build, {}; allowed: a file of this one, {}, or a new name", out.build,
                       build);
  }
  for (const SeedRange& old : out.ranges) {
    if (range.first <= old.last && old.first <= range.last)
      return fmt::format("has the seeds {}..{} already; allowed: other seeds", old.first, old.last);
  }
  return "";
}

bool write_soak_file(const std::filesystem::path& path, const SoakFile& file) {
  Json json;
  json["build"] = file.build;
  std::vector<SeedRange> ranges = file.ranges;
  std::sort(ranges.begin(), ranges.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const SeedRange& range : ranges) json["ranges"].push_back({range.first, range.last});
  for_each_count(file.totals, [&](const char* name, auto count) { json["totals"][name] = count; });
  json["totals"]["wall_s"] = file.totals.wall_s;
  const std::filesystem::path draft = path.string() + ".draft";
  std::ofstream stream(draft, std::ios::binary);
  stream << json.dump(2) << '\n';
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(draft, path, error);
  return stream && !error;
}

}  // namespace ballast
