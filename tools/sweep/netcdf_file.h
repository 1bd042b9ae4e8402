// A NetCDF-4 file that is written or read. After the first error every call does nothing, and error() says what it was.
#pragma once

#include <netcdf.h>

#include <cstdint>
#include <string>
#include <vector>

namespace ballast::sweep {

class NetcdfFile {
 public:
  enum class Mode { kWrite, kRead };  // kWrite replaces the file
  NetcdfFile(const std::string& path, Mode mode);
  ~NetcdfFile();
  NetcdfFile(const NetcdfFile&) = delete;
  NetcdfFile& operator=(const NetcdfFile&) = delete;

  int dimension(const std::string& name, std::size_t length);
  int variable(const std::string& name, nc_type type, const std::vector<int>& dimensions);
  // `variable` may be NC_GLOBAL.
  void attribute(int variable, const std::string& name, const std::string& text);
  void fill_value(int variable, double value);
  void end_definitions();

  // Along the first dimension from `first`; `width` is the length of the second, 0: there is none.
  void put(int variable, std::size_t first, const std::vector<double>& values, std::size_t width = 0);
  void put(int variable, std::size_t first, const std::vector<long long>& values);
  void put(int variable, std::size_t first, const std::vector<signed char>& values);
  void put(int variable, std::size_t first, const std::vector<const char*>& values);

  [[nodiscard]] int find_variable(const std::string& name);  // -1: none
  // False: there is no such variable.
  [[nodiscard]] bool shape(int variable, nc_type& type, int& dimensions);
  [[nodiscard]] std::string global_text(const std::string& name);         // an attribute; empty: there is none
  [[nodiscard]] std::uint64_t dimension_length(const std::string& name);  // 0: there is none
  [[nodiscard]] std::vector<double> numbers(int variable, std::size_t first, std::size_t count);
  [[nodiscard]] std::vector<std::string> texts(int variable, std::size_t first, std::size_t count);

  // Writes all data into the file; only then true.
  [[nodiscard]] bool close();
  [[nodiscard]] const std::string& error() const { return error_; }

 private:
  void check(int status);
  [[nodiscard]] bool good() const { return error_.empty(); }

  std::string path_;
  Mode mode_;
  int file_ = -1;
  std::string error_;
};

}  // namespace ballast::sweep
