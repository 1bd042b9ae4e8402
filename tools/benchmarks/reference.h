// What the paper's ball must come to: tests/data/paper_ball.csv, of an independent program (DOP853 at 3e-14), good to
// 1e-10 in the state. A benchmark says how far off it ends, for speed means nothing without it.
#pragma once

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace ballast::benchmarks {

using ReferenceRow = std::unordered_map<std::string, double>;

inline std::vector<ReferenceRow> reference_rows() {
  std::ifstream file(BALLAST_TEST_DATA "/paper_ball.csv");
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
  if (rows.empty()) throw std::runtime_error("cannot read " BALLAST_TEST_DATA "/paper_ball.csv");
  return rows;
}

}  // namespace ballast::benchmarks
