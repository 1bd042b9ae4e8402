// The reference page of the scenario keys, tools/docs/scenario.md, against the reader: the same keys, and for each the
// same allowed values and default. A cell that depends on the rest of the scenario is the page's own.
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "sim/scenario/check.h"
#include "sim/scenario/reader.h"
#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

struct Row {
  std::string allowed, fallback;
  bool allowed_varies = false, fallback_varies = false;
};

// The keys that are asked for in reading any of these texts.
std::map<std::string, Row> keys_of_reader(const std::vector<std::string>& texts) {
  std::map<std::string, Row> rows;
  for (const std::string& text : texts) {
    Node root;
    std::vector<ScenarioError> errors;
    std::vector<ReadKey> keys;
    std::vector<ScenarioError> warnings;
    ReadContext context{"keys.toml", errors, warnings, &keys};
    EXPECT_TRUE(read_tree(text, "keys.toml", root, errors));
    check_scenario(root, context);
    for (const ScenarioError& error : errors) ADD_FAILURE() << to_string(error);
    for (const ReadKey& key : keys) {
      Row& row = rows[key.key];
      if (key.allowed.empty()) continue;
      row.allowed_varies = row.allowed_varies || (!row.allowed.empty() && row.allowed != key.allowed);
      row.fallback_varies = row.fallback_varies || (!row.fallback.empty() && row.fallback != key.fallback);
      row.allowed = key.allowed;
      if (!key.fallback.empty()) row.fallback = key.fallback;
    }
  }
  return rows;
}

std::string trimmed(const std::string& cell) {
  const std::size_t begin = cell.find_first_not_of(" `"), end = cell.find_last_not_of(" `");
  return begin == std::string::npos ? "" : cell.substr(begin, end + 1 - begin);
}

// The rows of the page's tables whose first cell is a key: | `key` | allowed | default | meaning |
std::map<std::string, Row> keys_of_page() {
  std::ifstream file(BALLAST_KEY_PAGE);
  std::map<std::string, Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("| `")) continue;
    std::stringstream cells(line.substr(1));
    std::string key, allowed, fallback;
    std::getline(cells, key, '|');
    std::getline(cells, allowed, '|');
    std::getline(cells, fallback, '|');
    EXPECT_TRUE(rows.emplace(trimmed(key), Row{trimmed(allowed), trimmed(fallback)}).second) << key << " twice";
  }
  return rows;
}

std::string with(const std::string& from, const std::string& to) {
  const std::size_t at = kFull.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return kFull.substr(0, at) + to + kFull.substr(at + from.size());
}

// Another robot than kFull, so that computed defaults differ.
const std::string kOther =
    "duration = 1\ngravity = 10\nball = { radius = 1, mass = 1, inertia = [1, 1, 1] }\n"
    "[[mass]]\nmass = 1\nrail = { shape = \"line\", origin = [0, 0, 0], direction = [1, 0, 0] }\n"
    "motion = [ { duration = 0.01, acceleration = [500, 500] }, { duration = 0.01, acceleration = [-500, -500] } ]\n";

// Keys whose cells are the page's own: two meanings of one key, or a default that is no value of the key.
const std::set<std::string> kOwnWords{"control.tracking", "control.governor", "fault.N.axis",         "fault.N.channel",
                                      "fault.N.kind",     "initial.velocity", "mass.N.rail.direction"};

// Every table in every form that it can have.
std::vector<std::string> texts() {
  std::vector<std::string> all{
      kFull,
      kOther,
      with("external_force = [0.1, 0.2, 0.3]",
           "external_force = { times = [0, 1], forces = [[0, 0, 0], [1, 0, 0]] }\ndrag = { coefficient = 0.1 }"),
      with("corner_speed = 40.0", "preset = \"nema17\""),
      with("corner_speed = 40.0", "preset = \"nema23\""),
      with("{ shape = \"circle\", radius = 0.3, center = [0, 0, 0.1], axes = [[1, 0, 0], [0, 0, 1]] }",
           "{ shape = \"spline\", points = [[0, 0, 0], [0.2, 0, 0], [0.4, 0.1, 0]] }"),
      std::string("duration = 1\ngravity = 10\nball = { radius = 1, mass = 1, inertia = [1, 1, 1] }\n"
                  "run = { actuation = \"prescribed\" }\n[[mass]]\nmass = 1\n"
                  "trajectory = { times = [0, 1], points = [[0, 0, 0], [0.1, 0, 0]] }\n")};
  const std::string patches =
      "\n[[surface.patch]]\npolygon = [[0, 0], [1, 0], [0, 1]]\n[[surface.patch]]\ncircle = { center = [0, 0], radius "
      "= 1 }\n";
  all.push_back(kFull + patches);
  all.push_back(kOther + patches);
  const std::string sensors =
      "\n[sensors]\nattitude = \"sensed\"\nposition_fix = { rate = 10 }\nencoder = { resolution = 0.001 }\n";
  const std::string believed =
      "\n[believed]\nball = { radius = 2.1, mass = 1.5, inertia = [1, 1, 1], center_of_mass = [0, 0, 0] }\n"
      "surface = { static_friction = 0.3, slope = { angle = 0.1 } }\n[[believed.mass]]\nmass = 0.7\n";
  all.push_back(kFull + believed);
  all.push_back(kOther + "\n[believed]\nball = { mass = 2 }\nsurface = { static_friction = 0.3 }\n");
  all.push_back(kFull + sensors);
  all.push_back(kOther + sensors);
  all.push_back(kOther + "\n[sensors]\n");
  // `direction` of a push, `axis` and `sensor` of a sensor, `mass` of a motor, `channel` and `peer` of messages.
  for (const char* fault : {"kind = \"push\"\nvalue = 1\ndirection = [1, 0, 0]", "kind = \"weak_coil\"",
                            "kind = \"sensor_bias\"\nvalue = 1\naxis = 1", "kind = \"motor_stall\"",
                            "kind = \"messages_dropped\"\nchannel = \"BALLAST_SENSORS\"\npeer = \"monitor\""}) {
    all.push_back(kFull + "\n[[fault]]\ntime = 1\n" + fault + "\n");
    all.push_back(kOther + "\n[[fault]]\ntime = 0.5\n" + fault + "\n");
  }
  return all;
}

TEST(Keys, ThePageHasThoseOfTheReader) {
  const std::map<std::string, Row> reader = keys_of_reader(texts()), page = keys_of_page();
  for (const auto& [key, row] : page) EXPECT_TRUE(reader.contains(key)) << key << " is no key";
  for (const auto& [key, row] : reader) {
    const auto found = page.find(key);
    if (found == page.end()) {
      ADD_FAILURE() << "missing: | `" << key << "` | " << row.allowed << " | " << row.fallback << " | |";
      continue;
    }
    SCOPED_TRACE(key);
    if (kOwnWords.contains(key)) continue;
    if (!row.allowed.empty() && !row.allowed_varies) {
      EXPECT_EQ(found->second.allowed, row.allowed);
    }
    const bool is_the_truth = key.starts_with("believed.") && found->second.fallback.starts_with("the truth");
    if (!row.fallback.empty() && !row.fallback_varies && !is_the_truth) {
      EXPECT_EQ(found->second.fallback, row.fallback);
    }
  }
}

}  // namespace
}  // namespace ballast::sim
