// ballast._core: the package's part in C++.
#include "tools/program/subprocess.h"
#include "tools/python/bindings.h"

namespace ballast::python {
namespace {

// The package may be imported while it is only partly built, so its classes are looked up when they are needed.
[[noreturn]] void raise_instance(const char* class_name, const py::object& argument) {
  const py::object type = py::module_::import("ballast._errors").attr(class_name);
  PyErr_SetObject(type.ptr(), type(argument).ptr());
  throw py::error_already_set();
}

}  // namespace

void raise(const std::vector<sim::ScenarioError>& errors) {
  py::list found;
  for (const sim::ScenarioError& error : errors) {
    const auto or_none = [](const std::string& text) -> py::object {
      return text.empty() ? py::none() : py::object(py::str(text));
    };
    const py::object line = error.line > 0 ? py::object(py::int_(error.line)) : py::none();
    found.append(py::make_tuple(or_none(error.source), line, or_none(error.key), or_none(error.value), error.message,
                                to_string(error)));
  }
  raise_instance("ScenarioError", found);
}

void raise_run_error(const std::string& text) { raise_instance("RunError", py::str(text)); }

void look_for_signals() {
  const py::gil_scoped_acquire lock;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

}  // namespace ballast::python

PYBIND11_MODULE(_core, module) {
  using namespace ballast::python;
  ballast::program::use_programs_in(BALLAST_PROGRAMS);
  module.doc() = "The part of the package ballast in C++. Use the package.";
  module.attr("version") = BALLAST_VERSION;
  module.attr("programs") = BALLAST_PROGRAMS;
  add_scenario(module);
  add_run(module);
  add_closed_forms(module);
  add_plant(module);
  add_sweep(module);
}
