// The friction a run needs: how much, when, which load causes it, and which floors give it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tools/summary/summary.h"

namespace ballast::sil {

// The part of the greatest f_s / N that one load contributes (sim/plant/contact_shares.h); the parts sum to 1.
struct FrictionPart {
  std::string of;  // "mass 2", "the ball", "the outside force", "the floor's resistance"
  double part;
  double weight, motion, turning;  // `part` again, by cause
};

// The greatest first; empty if it was not needed by rolling, or nothing holds the ball on the floor at rest.
std::vector<FrictionPart> friction_parts(const RunResult& result);
// The same as a table for the terminal, in per cent.
std::string friction_parts_text(const RunResult& result);

// "needs 0.31 at 2.14 s because of mass 2 (81 %); rolls on aluminium and steel, not on glass".
std::string required_friction_text(const RunResult& result, const std::vector<FloorVerdict>& floors);

// The field `required_friction` of summary.json.
nlohmann::ordered_json required_friction_json(const RunResult& result, const std::vector<FloorVerdict>& floors);

}  // namespace ballast::sil
