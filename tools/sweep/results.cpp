#include "tools/sweep/results.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>

#include "tools/program/shared_text.h"
#include "tools/program/subprocess.h"
#include "tools/sweep/folder.h"
#include "tools/sweep/netcdf_file.h"

namespace ballast::sweep {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// The kind of a column: that of the most general of its cells.
struct Kind {
  bool text = false;
  bool list = false;
  std::size_t length = 0;  // of the longest list

  void take(const Cell& cell) {
    text = text || std::holds_alternative<std::string>(cell);
    if (const auto* values = std::get_if<std::vector<double>>(&cell)) {
      list = true;
      length = std::max(length, values->size());
    }
  }
};

struct Column {
  int variable = -1;
  Kind kind;

  [[nodiscard]] bool is_list() const { return kind.list && kind.length > 0 && !kind.text; }
};

double number_in(const Cell& cell) {
  const auto* value = std::get_if<double>(&cell);
  return value == nullptr ? kNone : *value;
}

// One column's cells of a block, written at once.
void put_column(NetcdfFile& file, const Column& column, std::size_t first, const std::vector<const Cell*>& cells) {
  if (column.kind.text) {
    std::vector<const char*> texts;
    for (const Cell* cell : cells) {
      const auto* text = std::get_if<std::string>(cell);
      texts.push_back(text == nullptr ? "" : text->c_str());
    }
    return file.put(column.variable, first, texts);
  }
  std::vector<double> numbers;
  for (const Cell* cell : cells) {
    if (!column.is_list()) {
      numbers.push_back(number_in(*cell));
      continue;
    }
    const auto* list = std::get_if<std::vector<double>>(cell);
    for (std::size_t i = 0; i < column.kind.length; ++i)
      numbers.push_back(list != nullptr && i < list->size() ? (*list)[i] : kNone);
  }
  file.put(column.variable, first, numbers, column.is_list() ? column.kind.length : 0);
}

class ResultsFile {
 public:
  ResultsFile(const std::string& path, const Spec& spec, const std::vector<Kind>& kinds)
      : spec_(spec), file_(path, NetcdfFile::Mode::kWrite) {
    rows_ = file_.dimension("row", spec.rows());
    row_ = integer("row", NC_INT64, "number of the run, for ballast sweep --row");
    seed_ = integer("seed", NC_INT64, "seed of the run");
    status_ = integer("exit_status", NC_BYTE,
                      "as ballast run returns: 0 inside the envelope, 1 refused by the scenario's check, 2 could not "
                      "run, 3 outside the envelope or tripped");
    held_ = integer("held", NC_BYTE, "1: exit_status 0");
    const std::vector<std::string> columns = columns_of(spec);
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      const bool varied = i < spec.vary.size();
      define(varied ? spec.vary[i].key : columns[i - spec.vary.size()], kinds[i],
             varied                                    ? "varied scenario key"
             : i - spec.vary.size() < spec.keep.size() ? "value of summary.json"
                                                       : "search for the limit of " + spec.find_limit + ":");
    }
    file_.attribute(NC_GLOBAL, "title", spec.name);
    file_.attribute(NC_GLOBAL, "source", "ballast sweep");
    file_.attribute(NC_GLOBAL, "sweep_toml", to_toml(spec));
    file_.attribute(NC_GLOBAL, "scenario_toml", spec.base_toml);
    file_.end_definitions();
  }

  void put(const Block& block) {
    std::vector<long long> numbers, seeds;
    std::vector<signed char> statuses, held;
    for (const RowResult& row : block.rows) {
      numbers.push_back(static_cast<long long>(row.number));
      seeds.push_back(static_cast<long long>(row.seed));
      statuses.push_back(static_cast<signed char>(row.exit_status));
      held.push_back(row.held() ? 1 : 0);
    }
    file_.put(row_, block.first_row, numbers);
    file_.put(seed_, block.first_row, seeds);
    file_.put(status_, block.first_row, statuses);
    file_.put(held_, block.first_row, held);
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      std::vector<const Cell*> cells;
      for (const RowResult& row : block.rows) {
        const std::size_t varied = row.varied.size();
        cells.push_back(i < varied ? &row.varied[i] : &row.kept[i - varied]);
      }
      put_column(file_, columns_[i], block.first_row, cells);
    }
  }

  [[nodiscard]] bool close() { return file_.close(); }
  [[nodiscard]] const std::string& error() const { return file_.error(); }

 private:
  int integer(const std::string& name, nc_type type, const std::string& meaning) {
    const int id = file_.variable(name, type, {rows_});
    file_.attribute(id, "long_name", meaning);
    return id;
  }

  void define(const std::string& key, const Kind& kind, const std::string& what) {
    Column column{-1, kind};
    const std::string name = variable_name(key);
    std::vector<int> dimensions{rows_};
    if (column.is_list()) dimensions.push_back(file_.dimension(name + "_index", kind.length));
    column.variable = file_.variable(name, kind.text ? NC_STRING : NC_DOUBLE, dimensions);
    file_.attribute(column.variable, "long_name", what + " " + key);
    if (!kind.text) file_.fill_value(column.variable, kNone);
    columns_.push_back(column);
  }

  const Spec& spec_;
  NetcdfFile file_;
  int rows_ = -1, row_ = -1, seed_ = -1, status_ = -1, held_ = -1;
  std::vector<Column> columns_;  // varied, then kept
};

// Writes the results under the draft's name. Empty, or what could not be done.
std::string write_draft(const std::string& draft, const Spec& spec, const TakeBlock& take_block) {
  const BlockPlan plan(spec);
  std::vector<Kind> kinds(spec.vary.size() + columns_of(spec).size());
  const auto missing = [&](std::uint64_t block) {
    return "rows " + std::to_string(plan.first_row(block)) + " to " +
           std::to_string(plan.first_row(block) + plan.rows_of(block) - 1) + " are missing";
  };
  for (std::uint64_t number = 0; number < plan.blocks(); ++number) {
    const auto block = take_block(number);
    if (!block) return missing(number);
    for (const RowResult& row : block->rows) {
      for (std::size_t i = 0; i < row.varied.size(); ++i) kinds[i].take(row.varied[i]);
      for (std::size_t i = 0; i < row.kept.size(); ++i) kinds[row.varied.size() + i].take(row.kept[i]);
    }
  }
  ResultsFile results(draft, spec, kinds);
  for (std::uint64_t number = 0; number < plan.blocks() && results.error().empty(); ++number) {
    const auto block = take_block(number);
    if (!block) return missing(number);
    results.put(*block);
  }
  static_cast<void>(results.close());
  return results.error();
}

// Gives the draft its name, or removes it after an error.
std::string renamed(const std::string& draft, const std::string& file, std::string error) {
  std::error_code code;
  if (error.empty()) std::filesystem::rename(draft, file, code);
  if (code) error = file + ": cannot be written: " + code.message();
  if (!error.empty()) std::filesystem::remove(draft, code);
  return error;
}

}  // namespace

std::string write_results(const std::string& file, const Spec& spec, const TakeBlock& take_block) {
  const std::string draft = file + ".part";
  program::SharedText error;
  if (!error.good()) return std::strerror(errno);
  std::fflush(nullptr);  // otherwise the child would print what is still buffered here
  program::Subprocess writer;
  const auto not_started = writer.start([&] {
    error.set(write_draft(draft, spec, take_block));
    return 0;
  });
  if (not_started) return not_started.message();
  const program::ProcessEnd end = writer.wait();
  std::string why = error.text();
  if (why.empty() && (end.exit_status != 0))
    why = draft + ": cannot be written; is the disk full? (" + end.text() + ")";
  return renamed(draft, file, why);
}

std::string results_refusal(const std::string& file, const Spec& spec) {
  NetcdfFile results(file, NetcdfFile::Mode::kRead);
  const bool same = results.global_text("sweep_toml") == to_toml(spec) &&
                    results.global_text("scenario_toml") == spec.base_toml &&
                    results.dimension_length("row") == spec.rows();
  if (!results.error().empty()) return results.error();
  return same
             ? ""
             : file +
                   ": holds the results of another sweep than sweep.toml beside it; remove it, and run the sweep again";
}

}  // namespace ballast::sweep
