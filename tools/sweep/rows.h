// The rows of a sweep: the seed and the varied values of every run, from the sweep's seed and the row's number alone.
#pragma once

#include <cstdint>
#include <vector>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

struct Row {
  std::uint64_t number = 0;       // from 0
  std::uint64_t seed = 0;         // of the run; below 2^53
  std::vector<sim::Node> values;  // one per Spec::vary
};

// The last grid of the file changes fastest among the grids; the random repeats of one point follow one another.
[[nodiscard]] Row make_row(const Spec& spec, std::uint64_t number);

// A number, or a list of them, as a value of --set.
[[nodiscard]] sim::Node number_node(double value);
[[nodiscard]] sim::Node list_node(const std::vector<double>& values);

}  // namespace ballast::sweep
