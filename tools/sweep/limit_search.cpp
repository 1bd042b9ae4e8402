#include "tools/sweep/limit_search.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "tools/program/program.h"

namespace ballast::sweep {
namespace {

const Variation* range_of(const Spec& spec, const std::string& key) {
  const auto found = std::find_if(spec.vary.begin(), spec.vary.end(), [&](const Variation& v) { return v.key == key; });
  return found == spec.vary.end() ? nullptr : &*found;
}

double middle(const Variation& range, double a, double b) {
  return range.distribution == Distribution::kLogUniform ? std::exp((std::log(a) + std::log(b)) / 2) : (a + b) / 2;
}

// The search of one row.
struct Search {
  Row row;
  double held = 0, lost = 0;  // the bracket
  bool searching = false;
  RowResult best;  // with the value `held`
};

bool was_run(const RowResult& result) {
  return result.exit_status != program::kExitUsage && result.exit_status != program::kExitCouldNotRun;
}

void finish(RowResult& result, Cell limit, Cell kind) {
  result.kept.push_back(std::move(limit));
  result.kept.push_back(std::move(kind));
}

class Searches {
 public:
  Searches(const Spec& spec, const std::vector<Row>& rows, const RunRows& run_rows)
      : range_(*range_of(spec, spec.find_limit)),
        place_(static_cast<std::size_t>(&range_ - spec.vary.data())),
        run_rows_(run_rows) {
    for (const Row& row : rows) searches_.push_back({row, 0, 0, false, {}});
  }

  std::vector<RowResult> results() {
    run_ends();
    for (int halving = 0; halving < kLimitHalvings; ++halving) halve();
    std::vector<RowResult> results;
    for (Search& s : searches_) {
      if (s.searching)
        finish(s.best, middle(range_, s.held, s.lost), std::string(s.held > s.lost ? "holds above" : "holds below"));
      results.push_back(std::move(s.best));
    }
    return results;
  }

 private:
  [[nodiscard]] Row row_with(const Search& search, double value) const {
    Row row = search.row;
    row.values[place_] = number_node(value);
    return row;
  }

  void run_ends() {
    std::vector<Row> ends;
    for (const Search& s : searches_) {
      ends.push_back(row_with(s, range_.a));
      ends.push_back(row_with(s, range_.b));
    }
    std::vector<RowResult> results = run_rows_(ends);
    for (std::size_t i = 0; i < searches_.size(); ++i) {
      RowResult &low = results[2 * i], &high = results[2 * i + 1];
      Search& s = searches_[i];
      s.searching = was_run(low) && was_run(high) && low.held() != high.held();
      s.held = low.held() ? range_.a : range_.b;
      s.lost = low.held() ? range_.b : range_.a;
      const bool take_high = s.searching ? high.held() : was_run(low) && !was_run(high);
      s.best = std::move(take_high ? high : low);
      if (s.searching) continue;
      const bool complete = was_run(s.best);
      finish(s.best, {}, !complete ? Cell() : std::string(s.best.held() ? "holds at both ends" : "holds at no end"));
    }
  }

  void halve() {
    std::vector<Row> rows;
    std::vector<Search*> of;
    for (Search& s : searches_) {
      if (!s.searching) continue;
      rows.push_back(row_with(s, middle(range_, s.held, s.lost)));
      of.push_back(&s);
    }
    std::vector<RowResult> results = run_rows_(rows);
    for (std::size_t i = 0; i < of.size(); ++i) {
      Search& s = *of[i];
      const double value = rows[i].values[place_].number;
      if (!was_run(results[i])) {
        s.searching = false;
        s.best = std::move(results[i]);
        finish(s.best, {}, {});
      } else if (results[i].held()) {
        s.held = value;
        s.best = std::move(results[i]);
      } else {
        s.lost = value;
      }
    }
  }

  const Variation& range_;
  std::size_t place_;  // of the key in Spec::vary
  const RunRows& run_rows_;
  std::vector<Search> searches_;
};

}  // namespace

std::string limit_refusal(const Spec& spec, const std::string& key) {
  const Variation* range = range_of(spec, key);
  const std::string allowed = "; allowed: a key of [vary] with uniform or log_uniform, whose range is searched";
  if (range == nullptr) return "is not varied" + allowed;
  const bool has_range =
      range->distribution == Distribution::kUniform || range->distribution == Distribution::kLogUniform;
  if (!has_range)
    return fmt::format("is varied with {}{}", kDistributionNames[static_cast<int>(range->distribution)], allowed);
  const bool correlated = std::any_of(spec.correlations.begin(), spec.correlations.end(),
                                      [&](const Correlation& c) { return c.first == key || c.second == key; });
  return correlated ? "is correlated with another key; allowed: a key without correlation" : "";
}

std::vector<RowResult> find_limits(const Spec& spec, const std::vector<Row>& rows, const RunRows& run_rows) {
  return Searches(spec, rows, run_rows).results();
}

}  // namespace ballast::sweep
