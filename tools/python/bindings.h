// The parts of the module ballast._core, each in a file of its own, and what they share. The module takes and returns
// plain values; the package's modules in Python give them names, documentation and classes.
//
// Threads: every function that computes for long releases the interpreter's lock, and takes it again now and then to
// look for signals, so that Ctrl-C raises KeyboardInterrupt. A Plant has a lock of its own.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "firmware/control/params.h"
#include "sim/scenario/scenario.h"

namespace ballast::python {

namespace py = pybind11;

// A scenario without errors. Never changes, so threads may share it.
struct CheckedScenario {
  sim::Scenario scenario;
  std::shared_ptr<const firmware::ControllerParams> params;  // null: no controller
  std::vector<sim::ScenarioError> warnings;                  // allowed and implausible values
};

// Raises ballast.ScenarioError. Needs the interpreter's lock.
[[noreturn]] void raise(const std::vector<sim::ScenarioError>& errors);
// Raises ballast.RunError.
[[noreturn]] void raise_run_error(const std::string& text);

// Handles pending signals. Throws what a handler has raised, such as KeyboardInterrupt. For threads without the
// interpreter's lock.
void look_for_signals();

// Without this, Python would make objects whose C++ part is not initialised. The package's own classes can be pickled.
template <class T>
void forbid_pickles(py::class_<T>& type) {
  type.def("__reduce_ex__", [](const py::object&, int) -> py::object { throw py::type_error("cannot be pickled"); });
}

// For a type whose objects never change: a copy is the object itself.
template <class T>
void share_copies(py::class_<T>& type) {
  type.def("__copy__", [](const py::object& self) { return self; })
      .def("__deepcopy__", [](const py::object& self, const py::object&) { return self; });
  forbid_pickles(type);
}

void add_scenario(py::module_& module);
void add_run(py::module_& module);
void add_closed_forms(py::module_& module);
void add_plant(py::module_& module);
void add_sweep(py::module_& module);

}  // namespace ballast::python
