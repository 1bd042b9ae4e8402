#include "tools/sweep/netcdf_file.h"

#include <dlfcn.h>

#include <cerrno>
#include <cstring>

namespace ballast::sweep {

namespace {

// The functions of libnetcdf in use. It and the forty libraries that it needs take 10 ms to load, a fifth of a short
// run, so they are loaded with the first file and not with the program.
struct Netcdf {
  void* library = dlopen(BALLAST_NETCDF, RTLD_NOW);
  std::string error = library == nullptr ? dlerror() : "";

  decltype(&nc_create) create = find<decltype(&nc_create)>("nc_create");
  decltype(&nc_open) open = find<decltype(&nc_open)>("nc_open");
  decltype(&nc_close) close = find<decltype(&nc_close)>("nc_close");
  decltype(&nc_set_fill) set_fill = find<decltype(&nc_set_fill)>("nc_set_fill");
  decltype(&nc_strerror) strerror = find<decltype(&nc_strerror)>("nc_strerror");
  decltype(&nc_def_dim) def_dim = find<decltype(&nc_def_dim)>("nc_def_dim");
  decltype(&nc_def_var) def_var = find<decltype(&nc_def_var)>("nc_def_var");
  decltype(&nc_put_att_text) put_att_text = find<decltype(&nc_put_att_text)>("nc_put_att_text");
  decltype(&nc_put_att_double) put_att_double = find<decltype(&nc_put_att_double)>("nc_put_att_double");
  decltype(&nc_inq_attlen) inq_attlen = find<decltype(&nc_inq_attlen)>("nc_inq_attlen");
  decltype(&nc_get_att_text) get_att_text = find<decltype(&nc_get_att_text)>("nc_get_att_text");
  decltype(&nc_inq_dimid) inq_dimid = find<decltype(&nc_inq_dimid)>("nc_inq_dimid");
  decltype(&nc_inq_dimlen) inq_dimlen = find<decltype(&nc_inq_dimlen)>("nc_inq_dimlen");
  decltype(&nc_enddef) enddef = find<decltype(&nc_enddef)>("nc_enddef");
  decltype(&nc_put_vara_double) put_vara_double = find<decltype(&nc_put_vara_double)>("nc_put_vara_double");
  decltype(&nc_put_vara_longlong) put_vara_longlong = find<decltype(&nc_put_vara_longlong)>("nc_put_vara_longlong");
  decltype(&nc_put_vara_schar) put_vara_schar = find<decltype(&nc_put_vara_schar)>("nc_put_vara_schar");
  decltype(&nc_put_vara_string) put_vara_string = find<decltype(&nc_put_vara_string)>("nc_put_vara_string");
  decltype(&nc_inq_varid) inq_varid = find<decltype(&nc_inq_varid)>("nc_inq_varid");
  decltype(&nc_inq_var) inq_var = find<decltype(&nc_inq_var)>("nc_inq_var");
  decltype(&nc_get_vara_double) get_vara_double = find<decltype(&nc_get_vara_double)>("nc_get_vara_double");
  decltype(&nc_get_vara_string) get_vara_string = find<decltype(&nc_get_vara_string)>("nc_get_vara_string");
  decltype(&nc_free_string) free_string = find<decltype(&nc_free_string)>("nc_free_string");

  // The function of this name; the type says its parameters.
  template <class Function>
  Function find(const char* name) {
    void* const function = library == nullptr ? nullptr : dlsym(library, name);
    if (function == nullptr && error.empty()) error = std::string(name) + " is missing in " BALLAST_NETCDF;
    return reinterpret_cast<Function>(function);
  }
};

const Netcdf& netcdf() {
  static const Netcdf functions;
  return functions;
}

}  // namespace

NetcdfFile::NetcdfFile(const std::string& path, Mode mode) : path_(path), mode_(mode), error_(netcdf().error) {
  if (!good()) return;
  check(mode == Mode::kWrite ? netcdf().create(path.c_str(), NC_NETCDF4 | NC_CLOBBER, &file_)
                             : netcdf().open(path.c_str(), NC_NOWRITE, &file_));
  if (!good()) file_ = -1;
  if (mode == Mode::kWrite && good()) check(netcdf().set_fill(file_, NC_NOFILL, nullptr));  // every value is written
}

NetcdfFile::~NetcdfFile() {
  if (file_ >= 0) netcdf().close(file_);
}

void NetcdfFile::check(int status) {
  if (status != NC_NOERR && good()) {
    error_ = path_ + ": " + netcdf().strerror(status);
    if (mode_ == Mode::kRead) {
      error_ += "; the file is damaged: remove it, and run the sweep again";
    } else if (status == NC_EHDFERR && errno != 0) {  // HDF5's only error; the system's tells a full disk
      error_ += std::string(" (") + std::strerror(errno) + ")";
    }
  }
  errno = 0;
}

int NetcdfFile::dimension(const std::string& name, std::size_t length) {
  int id = -1;
  if (good()) check(netcdf().def_dim(file_, name.c_str(), length, &id));
  return id;
}

int NetcdfFile::variable(const std::string& name, nc_type type, const std::vector<int>& dimensions) {
  int id = -1;
  if (good())
    check(netcdf().def_var(file_, name.c_str(), type, static_cast<int>(dimensions.size()), dimensions.data(), &id));
  return id;
}

void NetcdfFile::attribute(int variable, const std::string& name, const std::string& text) {
  if (good()) check(netcdf().put_att_text(file_, variable, name.c_str(), text.size(), text.c_str()));
}

void NetcdfFile::fill_value(int variable, double value) {
  if (good()) check(netcdf().put_att_double(file_, variable, "_FillValue", NC_DOUBLE, 1, &value));
}

void NetcdfFile::end_definitions() {
  if (good()) check(netcdf().enddef(file_));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<double>& values, std::size_t width) {
  if (!good() || values.empty()) return;
  const std::size_t start[] = {first, 0}, count[] = {width == 0 ? values.size() : values.size() / width, width};
  check(netcdf().put_vara_double(file_, variable, start, count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<long long>& values) {
  const std::size_t count = values.size();
  if (good() && count > 0) check(netcdf().put_vara_longlong(file_, variable, &first, &count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<signed char>& values) {
  const std::size_t count = values.size();
  if (good() && count > 0) check(netcdf().put_vara_schar(file_, variable, &first, &count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<const char*>& values) {
  const std::size_t count = values.size();
  std::vector<const char*> texts = values;
  if (good() && count > 0) check(netcdf().put_vara_string(file_, variable, &first, &count, texts.data()));
}

int NetcdfFile::find_variable(const std::string& name) {
  int id = -1;
  return good() && netcdf().inq_varid(file_, name.c_str(), &id) == NC_NOERR ? id : -1;
}

bool NetcdfFile::shape(int variable, nc_type& type, int& dimensions) {
  return good() && netcdf().inq_var(file_, variable, nullptr, &type, &dimensions, nullptr, nullptr) == NC_NOERR;
}

std::string NetcdfFile::global_text(const std::string& name) {
  std::size_t length = 0;
  if (!good() || netcdf().inq_attlen(file_, NC_GLOBAL, name.c_str(), &length) != NC_NOERR) return "";
  std::string text(length, '\0');
  if (length > 0) check(netcdf().get_att_text(file_, NC_GLOBAL, name.c_str(), text.data()));
  return text;
}

std::uint64_t NetcdfFile::dimension_length(const std::string& name) {
  int id = -1;
  std::size_t length = 0;
  if (!good() || netcdf().inq_dimid(file_, name.c_str(), &id) != NC_NOERR) return 0;
  check(netcdf().inq_dimlen(file_, id, &length));
  return length;
}

std::vector<double> NetcdfFile::numbers(int variable, std::size_t first, std::size_t count) {
  std::vector<double> values(count);
  if (good() && count > 0) check(netcdf().get_vara_double(file_, variable, &first, &count, values.data()));
  return values;
}

std::vector<std::string> NetcdfFile::texts(int variable, std::size_t first, std::size_t count) {
  std::vector<char*> pointers(count, nullptr);
  std::vector<std::string> values(count);
  if (!good() || count == 0) return values;
  const int status = netcdf().get_vara_string(file_, variable, &first, &count, pointers.data());
  check(status);
  if (status != NC_NOERR) return values;
  for (std::size_t i = 0; i < count; ++i) values[i] = pointers[i] == nullptr ? "" : pointers[i];
  netcdf().free_string(count, pointers.data());
  return values;
}

bool NetcdfFile::close() {
  if (file_ < 0) return false;
  const int file = file_;
  file_ = -1;
  const int status = netcdf().close(file);
  check(status);
  return good();
}

}  // namespace ballast::sweep
