// The commands of a command line as a table, for pages and scripts about them. Made of CLI11's own, so that neither can
// miss an option.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace ballast {

struct OptionRow {
  std::string name;                  // "--set"; of a positional "SCENARIO"
  std::string short_name;            // "-h", or empty
  bool takes_value = false;          // false: a flag
  bool repeatable = false;           // may be given more than once
  bool required = false;             // positionals
  std::vector<std::string> choices;  // the values allowed; empty: not a fixed set
  std::string description;
  std::string default_text;  // empty: none to show
};

struct CommandRow {
  std::string name;  // "run"; of the program itself empty
  std::string description;
  std::vector<OptionRow> positionals, options;

  // Takes a scenario: a file, or the name of one that ships.
  [[nodiscard]] bool takes_scenario() const;
};

struct CommandTable {
  std::string program;
  CommandRow itself;
  std::vector<CommandRow> commands;  // in the order of --help
};

CommandTable command_table(const CLI::App& app);

}  // namespace ballast
