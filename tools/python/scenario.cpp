// Reading and checking of scenarios for Python.
#include "sim/scenario/scenario.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/scenario/read_fault.h"
#include "sim/scenario/tree.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/python/bindings.h"

namespace ballast::python {
namespace {

using Texts = std::vector<std::string>;

std::string find(const std::string& name_or_path) {
  std::string why;
  const std::string file = program::scenario_file(name_or_path, why);
  // The words of the command begin with the name, as to_string() does with a source.
  if (file.empty()) raise({{name_or_path, 0, "", "", why.substr(std::min(why.size(), name_or_path.size() + 2))}});
  return file;
}

// Reads by `read`, and makes the controller's parameters, which may be refused too. Raises what is wrong.
template <class Read>
CheckedScenario check(const Read& read) {
  sim::ScenarioResult result;
  CheckedScenario out;
  {
    const py::gil_scoped_release unlocked;
    result = read();
    if (result.ok() && sim::has_controller(result.scenario.run.actuation)) {
      auto params = std::make_shared<firmware::ControllerParams>();
      const auto refusal = program::to_controller_params(result.scenario, *params);
      if (refusal) result.errors.push_back({result.scenario.name, 0, "", "", *refusal});
      out.params = std::move(params);
    }
  }
  if (!result.ok()) raise(result.errors);
  out.scenario = std::move(result.scenario);
  out.warnings = std::move(result.warnings);
  return out;
}

CheckedScenario check_file(const std::string& file, const Texts& overrides, const Texts& faults) {
  return check([&] { return sim::read_scenario(file, overrides, faults); });
}

// Lines of a text that was made of a dict mean nothing to its author.
CheckedScenario check_text(const std::string& toml, const std::string& source, const Texts& overrides,
                           const Texts& faults) {
  return check([&] {
    sim::ScenarioResult result = sim::parse_scenario(toml, source, overrides, faults);
    for (auto* found : {&result.errors, &result.warnings}) {
      for (sim::ScenarioError& error : *found) error.line = 0;
    }
    return result;
  });
}

std::string changed(const std::string& toml, const std::string& source, const Texts& overrides, const Texts& faults) {
  sim::Node root;
  std::vector<sim::ScenarioError> errors;
  if (sim::read_tree(toml, source, root, errors)) {
    for (const std::string& assignment : overrides) sim::apply_override(assignment, root, errors);
    for (const std::string& fault : faults) sim::add_fault(fault, root, errors);
  }
  if (!errors.empty()) raise(errors);
  return sim::to_toml(root);
}

// (key, the words of `ballast check`) of each.
std::vector<std::pair<std::string, std::string>> warnings(const CheckedScenario& checked) {
  std::vector<std::pair<std::string, std::string>> found;
  for (const sim::ScenarioError& warning : checked.warnings) found.emplace_back(warning.key, to_string(warning));
  return found;
}

double weight_n(const CheckedScenario& checked) {
  double mass_kg = checked.scenario.ball.mass_kg;
  for (const sim::Mass& mass : checked.scenario.masses) mass_kg += mass.mass_kg;
  return mass_kg * checked.scenario.gravity_mps2;
}

// Rail units per second.
double max_rate(const sim::Mass& mass) {
  return mass.motor.max_step_rate_hz / std::fabs(mass.motor.microsteps_per_rail_unit());
}

template <class Value>
auto of_masses(const CheckedScenario& checked, const Value& value) {
  std::vector<decltype(value(checked.scenario.masses.front()))> values;
  for (const sim::Mass& mass : checked.scenario.masses) values.push_back(value(mass));
  return values;
}

}  // namespace

void add_scenario(py::module_& module) {
  py::class_<CheckedScenario> checked(module, "CheckedScenario");
  share_copies(checked);
  checked.def_property_readonly("name", [](const CheckedScenario& s) { return s.scenario.name; })
      .def_property_readonly("toml", [](const CheckedScenario& s) { return s.scenario.toml; })
      .def_property_readonly("id", [](const CheckedScenario& s) { return s.scenario.id; })
      .def_property_readonly("duration_s", [](const CheckedScenario& s) { return s.scenario.duration_s; })
      .def_property_readonly("control_period_s",
                             [](const CheckedScenario& s) { return s.scenario.run.control_period_s; })
      .def_property_readonly("actuation", [](const CheckedScenario& s) { return to_string(s.scenario.run.actuation); })
      .def_property_readonly("mass_count", [](const CheckedScenario& s) { return s.scenario.masses.size(); })
      .def_property_readonly("weight_n", &weight_n)
      .def_property_readonly("max_acceleration",
                             [](const CheckedScenario& s) {
                               return of_masses(s, [](const sim::Mass& mass) { return mass.motor.max_acceleration; });
                             })
      .def_property_readonly("max_rate", [](const CheckedScenario& s) { return of_masses(s, max_rate); })
      .def_property_readonly("rail_ends",
                             [](const CheckedScenario& s) {
                               return of_masses(s, [](const sim::Mass& mass) {
                                 return std::pair(mass.rail.lower_end, mass.rail.upper_end);
                               });
                             })
      .def_property_readonly("warnings", &warnings);
  module.def("find_scenario", &find, py::arg("name_or_path"));
  module.def("check_file", &check_file, py::arg("file"), py::arg("overrides"), py::arg("faults"));
  module.def("check_text", &check_text, py::arg("toml"), py::arg("source"), py::arg("overrides"), py::arg("faults"));
  module.def("changed_toml", &changed, py::arg("toml"), py::arg("source"), py::arg("overrides"), py::arg("faults"));
}

}  // namespace ballast::python
