#include "tools/sweep/summary_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "tools/program/program.h"
#include "tools/sweep/binomial.h"
#include "tools/sweep/netcdf_file.h"
#include "tools/sweep/order_statistics.h"
#include "tools/sweep/results.h"
#include "tools/sweep/run_row.h"

namespace ballast::sweep {
namespace {

constexpr std::size_t kChunk = 1 << 16;  // rows read at once
constexpr std::size_t kMostTexts = 20;   // different texts of a column that are counted one by one
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kExtrema[] = {"mu_required.", "normal_force.", "static_friction.", "motor_share."};

std::string percent(double share) { return fmt::format("{:.4g} %", 100 * share); }

bool varies_at_random(const Spec& spec) {
  return std::any_of(spec.vary.begin(), spec.vary.end(),
                     [](const Variation& v) { return v.distribution != Distribution::kGrid; });
}

// Calls `take(first, count)` for parts of all rows.
template <class Take>
void for_each_chunk(std::uint64_t rows, const Take& take) {
  for (std::uint64_t first = 0; first < rows; first += kChunk)
    take(static_cast<std::size_t>(first), static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, rows - first)));
}

class Page {
 public:
  Page(NetcdfFile& file, const Spec& spec) : file_(file), spec_(spec), random_(varies_at_random(spec)) {}

  std::string text() {
    out_ = fmt::format("{}: {} run{} of {}, seed {}\n", spec_.name, spec_.rows(), spec_.rows() == 1 ? "" : "s",
                       spec_.base_name, spec_.seed);
    count_statuses();
    if (spec_.find_limit.empty())
      line("holds", ran() > 0 ? share(held_, ran()) : "no run could be run");
    else
      line("searched", searched_text());
    for (const std::string& name : columns_of(spec_)) {
      const int variable = file_.find_variable(variable_name(name));
      nc_type type = NC_DOUBLE;
      int dimensions = 0;
      if (variable < 0 || !file_.shape(variable, type, dimensions) || dimensions != 1) continue;
      if (type == NC_STRING)
        add_texts(name, variable);
      else
        add_numbers(name, variable);
    }
    const std::string worst = spec_.find_limit.empty() ? worst_text() : "";
    if (!worst.empty()) line("worst", worst);
    add_failures();
    return out_;
  }

  // "holds in 99.2 % (98.9 to 99.4) of 10000 runs; worst: ..."
  std::string sentence() {
    count_statuses();
    std::string not_run, worst = worst_text();
    if (ran() < spec_.rows())
      not_run = fmt::format("{} of {} were refused or could not be run", spec_.rows() - ran(), spec_.rows());
    if (ran() == 0) return "is not known to hold: " + not_run;
    const double part = static_cast<double>(held_) / static_cast<double>(ran());
    const Interval interval = wilson_interval(held_, ran());
    return fmt::format("holds in {} ({:.4g} to {:.4g}) of {} runs{}{}", percent(part), 100 * interval.low,
                       100 * interval.high, ran(), not_run.empty() ? "" : "; " + not_run,
                       worst.empty() ? "" : "; worst: " + worst);
  }

 private:
  void line(const std::string& name, const std::string& text) { out_ += fmt::format("  {:<22} {}\n", name, text); }

  [[nodiscard]] std::string share(std::uint64_t hits) const { return share(hits, spec_.rows()); }
  [[nodiscard]] std::string share(std::uint64_t hits, std::uint64_t of) const {
    const double part = static_cast<double>(hits) / static_cast<double>(of);
    if (!random_) return fmt::format("{}, {} of {}", percent(part), hits, of);
    const Interval interval = wilson_interval(hits, of);
    return fmt::format("{} ({:.4g} to {:.4g}), {} of {}", percent(part), 100 * interval.low, 100 * interval.high, hits,
                       of);
  }

  // Runs that the scenario's check did not refuse and that could be run.
  [[nodiscard]] std::uint64_t ran() const { return spec_.rows() - refused_.count - could_not_.count; }

  [[nodiscard]] std::string searched_text() const {
    const auto range = std::find_if(spec_.vary.begin(), spec_.vary.end(),
                                    [this](const Variation& v) { return v.key == spec_.find_limit; });
    return fmt::format("the limit of {} from {:.4g} to {:.4g}", range->key, range->a, range->b);
  }

  // A run, as worst_text() compares it.
  struct Run {
    bool held = true;
    double use = -1, mu = 0, floor = 0, time_s = 0;  // use: part of the floor's friction
    std::uint64_t row = 0;

    // A run that did not hold is worse than any that did, the earlier the worse, since its f_s/N is known up to its end
    // only. Of those that held, the one with the greatest use.
    [[nodiscard]] bool worse_than(const Run& other) const {
      if (held != other.held) return !held;
      if (!held && time_s != other.time_s) return time_s < other.time_s;
      return use > other.use;
    }
  };

  // Empty: the results do not tell.
  std::string worst_text() {
    const int mu = file_.find_variable("mu_required_max"), floor = file_.find_variable("surface_static_friction");
    const int reason = file_.find_variable("end_reason"), time = file_.find_variable("end_time");
    const int status = file_.find_variable("exit_status");
    if (mu < 0 || reason < 0 || time < 0) return "";
    Run worst;
    for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
      const std::vector<double> mus = file_.numbers(mu, first, count), times = file_.numbers(time, first, count);
      const std::vector<double> floors = floor < 0 ? std::vector(count, kUnknown) : file_.numbers(floor, first, count);
      const std::vector<double> statuses = file_.numbers(status, first, count);
      for (std::size_t i = 0; i < count; ++i) {
        if (std::isnan(mus[i])) continue;
        const bool plain = std::isinf(mus[i]) || !std::isfinite(floors[i]);
        const Run run{statuses[i] == program::kExitCompleted,
                      plain ? mus[i] : mus[i] / floors[i],
                      mus[i],
                      floors[i],
                      times[i],
                      first + i};
        if (worst.use < 0 || run.worse_than(worst)) worst = run;
      }
    });
    if (worst.use < 0) return "";
    std::string needs = std::isinf(worst.mu) ? "N fell to 0" : fmt::format("f_s/N up to {:.4g}", worst.mu);
    if (std::isfinite(worst.floor)) needs += fmt::format(" on a floor of {:.4g}", worst.floor);
    return fmt::format("{} at t = {:.4g} s, {}, row {}", file_.texts(reason, worst.row, 1).front(), worst.time_s, needs,
                       worst.row);
  }

  void count_statuses() {
    held_ = 0;
    refused_ = could_not_ = {};
    const int variable = file_.find_variable("exit_status");
    for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
      const std::vector<double> statuses = file_.numbers(variable, first, count);
      for (std::size_t i = 0; i < count; ++i) {
        const auto status = static_cast<int>(statuses[i]);
        held_ += status == program::kExitCompleted;
        if (status != program::kExitUsage && status != program::kExitCouldNotRun) continue;
        Failures& failures = status == program::kExitUsage ? refused_ : could_not_;
        if (failures.count++ == 0) failures.first_row = first + i;
      }
    });
  }

  void add_texts(const std::string& name, int variable) {
    std::map<std::string, std::uint64_t> counts;
    bool too_many = false;
    for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
      for (const std::string& text : file_.texts(variable, first, count)) {
        too_many = too_many || (counts.size() >= kMostTexts && !counts.contains(text));
        if (!too_many) ++counts[text];
      }
    });
    if (too_many) return line(name, fmt::format("more than {} different texts", kMostTexts));
    std::vector<std::pair<std::string, std::uint64_t>> sorted(counts.begin(), counts.end());
    std::stable_sort(sorted.begin(), sorted.end(), [](const auto& x, const auto& y) { return x.second > y.second; });
    for (const auto& [text, count] : sorted) line(name + (text.empty() ? ": no result" : ": " + text), share(count));
  }

  // A run that does not hold ends early, so that its extrema say little: where some hold, only theirs count.
  [[nodiscard]] bool of_those_that_hold(const std::string& name) const {
    return spec_.find_limit.empty() && held_ > 0 && held_ < ran() &&
           std::any_of(std::begin(kExtrema), std::end(kExtrema), [&](const char* of) { return name.starts_with(of); });
  }

  void add_numbers(const std::string& name, int variable) {
    const bool only_held = of_those_that_hold(name);
    const int status = file_.find_variable("exit_status");
    const ForEachNumber for_each = [&](const std::function<void(double)>& take) {
      for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
        const std::vector<double> values = file_.numbers(variable, first, count);
        const std::vector<double> statuses = only_held ? file_.numbers(status, first, count) : std::vector<double>();
        for (std::size_t i = 0; i < count; ++i) {
          if (!only_held || statuses[i] == program::kExitCompleted) take(values[i]);
        }
      });
    };
    std::uint64_t known = 0;
    for_each([&known](double value) { known += !std::isnan(value); });
    if (known == 0) return line(name, "no run has it");
    constexpr std::array kShares{0.05, 0.5, 0.95};
    std::vector<std::uint64_t> ranks{0, known - 1};
    std::vector<QuantileRanks> quantiles;
    for (const double part : kShares) {
      const QuantileRanks& of = quantiles.emplace_back(quantile_ranks(part, known));
      ranks.insert(ranks.end(), {of.value, of.low.value_or(0), of.high.value_or(known - 1)});
    }
    const std::vector<double> values = values_at_ranks(for_each, ranks);
    std::string text = fmt::format("least {:.4g}", values[0]);
    for (std::size_t i = 0; i < kShares.size(); ++i) {
      const double* of = &values[2 + 3 * i];
      const std::string label = kShares[i] == 0.5 ? "median" : fmt::format("{:.0f} %", 100 * kShares[i]);
      text += fmt::format(", {} {:.4g}", label, of[0]);
      const auto end = [](bool is_known, double value) { return is_known ? fmt::format("{:.4g}", value) : "?"; };
      if (random_)
        text += fmt::format(" ({} to {})", end(quantiles[i].low.has_value(), of[1]),
                            end(quantiles[i].high.has_value(), of[2]));
    }
    text += fmt::format(", greatest {:.4g}", values[1]);
    if (known < spec_.rows())
      text += fmt::format("; of {} run{}{}", known, known == 1 ? "" : "s", only_held ? " that hold" : "");
    line(name, text);
  }

  // A run that was refused or failed, with the reason of the first.
  struct Failures {
    std::uint64_t count = 0, first_row = 0;
  };
  void add_failures() {
    for (const auto& [failures, what] : {std::pair{refused_, "refused"}, std::pair{could_not_, "could not run"}}) {
      if (failures.count == 0) continue;
      std::string why;
      const RowScenarios scenarios(spec_);
      static_cast<void>(run_row(spec_, scenarios, make_row(spec_, failures.first_row), &why));
      line(what, fmt::format("{}; first row {}: {}", share(failures.count), failures.first_row, why));
    }
  }

  NetcdfFile& file_;
  const Spec& spec_;
  bool random_;
  std::string out_;
  std::uint64_t held_ = 0;
  Failures refused_, could_not_;
};

}  // namespace

std::string summary_page(const std::string& results_file, const Spec& spec, std::string& error) {
  NetcdfFile file(results_file, NetcdfFile::Mode::kRead);
  const std::string text = Page(file, spec).text();
  error = file.error();
  return error.empty() ? text : "";
}

std::string robustness_sentence(const std::string& results_file, const Spec& spec, std::string& error) {
  NetcdfFile file(results_file, NetcdfFile::Mode::kRead);
  const std::string text = Page(file, spec).sentence();
  error = file.error();
  return error.empty() ? text : "";
}

}  // namespace ballast::sweep
