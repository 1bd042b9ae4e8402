// belief.csv: the believed robot's forces and path over time.
#include <fmt/format.h>

#include <iterator>
#include <limits>

#include "tools/summary/summary.h"

namespace ballast::sil {

std::string belief_csv(const RunResult& result) {
  if (!result.belief) return "";
  std::string text = "time_s,position_1_m,position_2_m,normal_force_n,static_friction_n,mu_required\n";
  for (const BeliefRow& row : result.belief->rows) {
    const double mu_required =
        row.normal_force_n > 0 ? row.static_friction_n / row.normal_force_n : std::numeric_limits<double>::infinity();
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{}\n", row.time_s, row.position_W_m[0],
                   row.position_W_m[1], row.normal_force_n, row.static_friction_n, mu_required);
  }
  return text;
}

}  // namespace ballast::sil
