// ballast._core: the package's part in C++.
#include <dlfcn.h>

#include <filesystem>

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

// The folder of the program `ballast`. An installation has it at a fixed place relative to this module.
std::filesystem::path programs_folder() {
  Dl_info module;
  if (dladdr(reinterpret_cast<const void*>(&raise_run_error), &module) != 0) {
    std::error_code code;
    const auto file = std::filesystem::canonical(module.dli_fname, code);
    const auto folder = (file.parent_path() / BALLAST_PROGRAMS_FROM_MODULE).lexically_normal();
    if (std::filesystem::exists(folder / "ballast", code)) return folder;
  }
  return BALLAST_PROGRAMS;
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
  const std::filesystem::path programs = programs_folder();
  ballast::program::use_programs_in(programs);
  module.doc() = "The part of the package ballast in C++. Use the package.";
  module.attr("version") = BALLAST_VERSION;
  module.attr("programs") = programs.string();
  add_scenario(module);
  add_run(module);
  add_closed_forms(module);
  add_plant(module);
  add_sweep(module);
}
