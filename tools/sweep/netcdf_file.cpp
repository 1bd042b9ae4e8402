#include "tools/sweep/netcdf_file.h"

#include <cerrno>
#include <cstring>

namespace ballast::sweep {

NetcdfFile::NetcdfFile(const std::string& path, Mode mode) : path_(path) {
  check(mode == Mode::kWrite ? nc_create(path.c_str(), NC_NETCDF4 | NC_CLOBBER, &file_)
                             : nc_open(path.c_str(), NC_NOWRITE, &file_));
  if (!good()) file_ = -1;
  if (mode == Mode::kWrite && good()) check(nc_set_fill(file_, NC_NOFILL, nullptr));  // every value is written
}

NetcdfFile::~NetcdfFile() {
  if (file_ >= 0) nc_close(file_);
}

void NetcdfFile::check(int status) {
  // HDF5 has one error for everything; the system's error tells a full disk.
  if (status != NC_NOERR && good()) {
    error_ = path_ + ": " + nc_strerror(status);
    if (status == NC_EHDFERR && errno != 0) error_ += std::string(" (") + std::strerror(errno) + ")";
  }
  errno = 0;
}

int NetcdfFile::dimension(const std::string& name, std::size_t length) {
  int id = -1;
  if (good()) check(nc_def_dim(file_, name.c_str(), length, &id));
  return id;
}

int NetcdfFile::variable(const std::string& name, nc_type type, const std::vector<int>& dimensions) {
  int id = -1;
  if (good()) check(nc_def_var(file_, name.c_str(), type, static_cast<int>(dimensions.size()), dimensions.data(), &id));
  return id;
}

void NetcdfFile::attribute(int variable, const std::string& name, const std::string& text) {
  if (good()) check(nc_put_att_text(file_, variable, name.c_str(), text.size(), text.c_str()));
}

void NetcdfFile::fill_value(int variable, double value) {
  if (good()) check(nc_put_att_double(file_, variable, "_FillValue", NC_DOUBLE, 1, &value));
}

void NetcdfFile::end_definitions() {
  if (good()) check(nc_enddef(file_));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<double>& values, std::size_t width) {
  if (!good() || values.empty()) return;
  const std::size_t start[] = {first, 0}, count[] = {width == 0 ? values.size() : values.size() / width, width};
  check(nc_put_vara_double(file_, variable, start, count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<long long>& values) {
  const std::size_t count = values.size();
  if (good() && count > 0) check(nc_put_vara_longlong(file_, variable, &first, &count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<signed char>& values) {
  const std::size_t count = values.size();
  if (good() && count > 0) check(nc_put_vara_schar(file_, variable, &first, &count, values.data()));
}

void NetcdfFile::put(int variable, std::size_t first, const std::vector<const char*>& values) {
  const std::size_t count = values.size();
  std::vector<const char*> texts = values;
  if (good() && count > 0) check(nc_put_vara_string(file_, variable, &first, &count, texts.data()));
}

int NetcdfFile::find_variable(const std::string& name) {
  int id = -1;
  return good() && nc_inq_varid(file_, name.c_str(), &id) == NC_NOERR ? id : -1;
}

bool NetcdfFile::shape(int variable, nc_type& type, int& dimensions) {
  return good() && nc_inq_var(file_, variable, nullptr, &type, &dimensions, nullptr, nullptr) == NC_NOERR;
}

std::vector<double> NetcdfFile::numbers(int variable, std::size_t first, std::size_t count) {
  std::vector<double> values(count);
  if (good() && count > 0) check(nc_get_vara_double(file_, variable, &first, &count, values.data()));
  return values;
}

std::vector<std::string> NetcdfFile::texts(int variable, std::size_t first, std::size_t count) {
  std::vector<char*> pointers(count, nullptr);
  std::vector<std::string> values(count);
  if (!good() || count == 0) return values;
  const int status = nc_get_vara_string(file_, variable, &first, &count, pointers.data());
  check(status);
  if (status != NC_NOERR) return values;
  for (std::size_t i = 0; i < count; ++i) values[i] = pointers[i] == nullptr ? "" : pointers[i];
  nc_free_string(count, pointers.data());
  return values;
}

bool NetcdfFile::close() {
  if (file_ < 0) return false;
  const int file = file_;
  file_ = -1;
  const int status = nc_close(file);
  check(status);
  return good();
}

}  // namespace ballast::sweep
