// How far the ball would coast from the end of a run on floors that people have: physics.md, "How far it coasts".
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tools/sil/run.h"

namespace ballast::sil {

// A floor and the range of c_rr that was published for it; floors.md has the sources.
struct ResistingFloor {
  const char* name;
  double least_resistance, most_resistance;
};
inline constexpr std::array kResistingFloors{ResistingFloor{"wood", .001, .01}, ResistingFloor{"linoleum", .0014, .01},
                                             ResistingFloor{"concrete", .002, .015},
                                             ResistingFloor{"asphalt", .004, .02}, ResistingFloor{"carpet", .013, .1}};

// A ball that rolls on with its masses held, about the horizontal axis that it turns about at the end. Its spin about
// the vertical, drag and outside forces are left out.
struct Coast {
  double energy_j;        // kinetic, and of the weight above the lowest place of the centre of mass on the way
  double weight_n;        // of everything
  bool turns_over;        // the centre of mass passes its highest place; otherwise the ball rocks to rest
  double own_distance_m;  // with the resistance of the floor under the ball; +infinity where it does not resist

  // Length of the path, rocking included, until the work of the resistance has used the energy up.
  [[nodiscard]] double distance_m(double rolling_resistance) const;
};

// None unless the ball rolls at the end, on a level floor that weight presses it on.
std::optional<Coast> coast(const sim::Scenario& scenario, const sim::Plant::Sample& end);

// The field `coast` of summary.json, and the line for the terminal: empty where there is nothing to say.
nlohmann::ordered_json coast_json(const sim::Scenario& scenario, const RunResult& result);
std::string coast_line(const sim::Scenario& scenario, const RunResult& result);

}  // namespace ballast::sil
