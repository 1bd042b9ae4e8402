// The results of a sweep for Python: sweep.nc, column by column.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <functional>
#include <mutex>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "tools/python/bindings.h"
#include "tools/sweep/netcdf_file.h"

namespace ballast::python {
namespace {

using sweep::NetcdfFile;

// HDF5 is not made for threads. Taken without the interpreter's lock only, so that nobody waits for both.
std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

// The names of all columns, each with its meaning in words.
std::vector<std::pair<std::string, std::string>> columns(const std::string& path) {
  std::vector<std::pair<std::string, std::string>> found;
  std::string error;
  {
    const py::gil_scoped_release unlocked;
    const std::lock_guard lock(library_mutex());
    NetcdfFile file(path, NetcdfFile::Mode::kRead);
    for (const std::string& name : file.variable_names())
      found.emplace_back(name, file.text(file.find_variable(name), "long_name"));
    error = file.error();
  }
  if (!error.empty()) raise_run_error(error);
  return found;
}

struct Values {
  std::vector<std::size_t> lengths;
  std::vector<double> reals;
  std::vector<long long> integers;
  std::vector<std::string> texts;
  nc_type type = NC_NAT;
  std::string error;
};

// Without the interpreter's lock.
Values read(const std::string& path, const std::string& name) {
  Values values;
  const std::lock_guard lock(library_mutex());
  NetcdfFile file(path, NetcdfFile::Mode::kRead);
  const int variable = file.find_variable(name);
  int dimensions = 0;
  if (!file.shape(variable, values.type, dimensions)) {
    values.error = file.error().empty() ? path + ": has no column " + name : file.error();
    return values;
  }
  values.lengths = file.lengths(variable);
  const std::size_t count =
      std::accumulate(values.lengths.begin(), values.lengths.end(), std::size_t{1}, std::multiplies<>());
  if (values.type == NC_STRING && dimensions == 1) {
    values.texts = file.texts(variable, 0, count);
  } else if (values.type == NC_DOUBLE) {
    values.reals.resize(count);
    file.read(variable, values.reals.data());
  } else {
    values.integers.resize(count);
    file.read(variable, values.integers.data());
  }
  values.error = file.error();
  return values;
}

// A column: an array of double or int64, or a list of str.
py::object column(const std::string& path, const std::string& name) {
  Values values;
  {
    const py::gil_scoped_release unlocked;
    values = read(path, name);
  }
  if (!values.error.empty()) raise_run_error(values.error);
  if (values.type == NC_STRING) return py::cast(values.texts);
  const std::vector<py::ssize_t> shape(values.lengths.begin(), values.lengths.end());
  if (values.type == NC_DOUBLE) return py::array_t<double>(shape, values.reals.data());
  return py::array_t<long long>(shape, values.integers.data());
}

}  // namespace

void add_sweep(py::module_& module) {
  module.def("sweep_columns", &columns, py::arg("file"));
  module.def("sweep_column", &column, py::arg("file"), py::arg("name"));
}

}  // namespace ballast::python
