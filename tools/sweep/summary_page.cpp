#include "tools/sweep/summary_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
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
      line("holds", share(held_));
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
    const double part = static_cast<double>(held_) / static_cast<double>(spec_.rows());
    const Interval interval = wilson_interval(held_, spec_.rows());
    const std::string worst = worst_text();
    return fmt::format("holds in {} ({:.4g} to {:.4g}) of {} runs{}", percent(part), 100 * interval.low,
                       100 * interval.high, spec_.rows(), worst.empty() ? "" : "; worst: " + worst);
  }

 private:
  void line(const std::string& name, const std::string& text) { out_ += fmt::format("  {:<22} {}\n", name, text); }

  [[nodiscard]] std::string share(std::uint64_t hits) const {
    const double part = static_cast<double>(hits) / static_cast<double>(spec_.rows());
    if (!random_) return fmt::format("{}, {} of {}", percent(part), hits, spec_.rows());
    const Interval interval = wilson_interval(hits, spec_.rows());
    return fmt::format("{} ({:.4g} to {:.4g}), {} of {}", percent(part), 100 * interval.low, 100 * interval.high, hits,
                       spec_.rows());
  }

  [[nodiscard]] std::string searched_text() const {
    const auto range = std::find_if(spec_.vary.begin(), spec_.vary.end(),
                                    [this](const Variation& v) { return v.key == spec_.find_limit; });
    return fmt::format("the limit of {} from {:.4g} to {:.4g}", range->key, range->a, range->b);
  }

  // The row that needs the greatest part of its floor's friction; where N fell to 0 that is infinite, and the earliest
  // end counts. Empty: the results do not tell.
  std::string worst_text() {
    const int mu = file_.find_variable("mu_required_max"), floor = file_.find_variable("surface_static_friction");
    const int reason = file_.find_variable("end_reason"), time = file_.find_variable("end_time");
    if (mu < 0 || reason < 0 || time < 0) return "";
    struct {
      double use = -1, mu = 0, time_s = 0;
      std::uint64_t row = 0;
    } worst;
    for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
      const std::vector<double> mus = file_.numbers(mu, first, count), times = file_.numbers(time, first, count);
      const std::vector<double> floors = floor < 0 ? std::vector(count, 1.0) : file_.numbers(floor, first, count);
      for (std::size_t i = 0; i < count; ++i) {
        const double use = std::isinf(mus[i]) || std::isinf(floors[i]) ? mus[i] : mus[i] / floors[i];
        if (use > worst.use || (use == worst.use && times[i] < worst.time_s))
          worst = {use, mus[i], times[i], first + i};
      }
    });
    if (worst.use < 0) return "";
    const std::string needs = std::isinf(worst.mu) ? "N fell to 0" : fmt::format("f_s/N up to {:.4g}", worst.mu);
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
    for (const auto& [text, count] : sorted) line(name + (text.empty() ? ": none" : ": " + text), share(count));
  }

  void add_numbers(const std::string& name, int variable) {
    const ForEachNumber for_each = [&](const std::function<void(double)>& take) {
      for_each_chunk(spec_.rows(), [&](std::size_t first, std::size_t count) {
        for (const double value : file_.numbers(variable, first, count)) take(value);
      });
    };
    std::uint64_t known = 0;
    for_each([&known](double value) { known += !std::isnan(value); });
    if (known == 0) return line(name, "no run has it");
    constexpr std::array kShares{0.05, 0.5, 0.95};
    std::vector<std::uint64_t> ranks{0, known - 1};
    for (const double part : kShares) {
      const QuantileRanks of = quantile_ranks(part, known);
      ranks.insert(ranks.end(), {of.value, of.low, of.high});
    }
    const std::vector<double> values = values_at_ranks(for_each, ranks);
    std::string text = fmt::format("least {:.4g}", values[0]);
    for (std::size_t i = 0; i < kShares.size(); ++i) {
      const double* of = &values[2 + 3 * i];
      const std::string label = kShares[i] == 0.5 ? "median" : fmt::format("{:.0f} %", 100 * kShares[i]);
      text += fmt::format(", {} {:.4g}", label, of[0]);
      if (random_) text += fmt::format(" ({:.4g} to {:.4g})", of[1], of[2]);
    }
    text += fmt::format(", greatest {:.4g}", values[1]);
    if (known < spec_.rows()) text += fmt::format("; of {} runs", known);
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
