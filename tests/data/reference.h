// The paper's runs by an independent program (Newton-Euler in Python, DOP853 at 3e-14), good to about 1e-10 in the
// state at t = 20: tests/data/*.csv, for tests and benchmarks. Needs BALLAST_TEST_DATA.
#pragma once

#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace ballast::test {

using ReferenceRow = std::map<std::string, double>;  // by column

// Throws if the file gives no row.
inline std::vector<ReferenceRow> reference_rows(const std::string& name) {
  std::ifstream file(std::string(BALLAST_TEST_DATA) + "/" + name + ".csv");
  std::string line, cell;
  std::vector<std::string> columns;
  std::getline(file, line);
  for (std::stringstream s(line); std::getline(s, cell, ',');) columns.push_back(cell);
  std::vector<ReferenceRow> rows;
  while (std::getline(file, line)) {
    ReferenceRow& row = rows.emplace_back();
    std::stringstream s(line);
    for (const auto& column : columns) {
      std::getline(s, cell, ',');
      row[column] = std::stod(cell);
    }
  }
  if (rows.empty()) throw std::runtime_error("cannot read " BALLAST_TEST_DATA "/" + name + ".csv");
  return rows;
}

}  // namespace ballast::test
