#include "tools/ballast/command_table.h"

#include <algorithm>

namespace ballast {
namespace {

// The allowed values of a check by program::one_of(), which names itself "{a,b,c}".
std::vector<std::string> choices(const std::string& type) {
  const std::size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

OptionRow option_row(const CLI::Option& option) {
  OptionRow row;
  if (option.get_positional()) {
    row.name = option.get_name(true);
  } else {
    if (!option.get_lnames().empty()) row.name = "--" + option.get_lnames().front();
    if (!option.get_snames().empty()) row.short_name = "-" + option.get_snames().front();
  }
  row.takes_value = option.get_items_expected_max() > 0;
  row.repeatable = option.get_expected_max() > 1;
  row.required = option.get_required();
  row.choices = choices(option.get_type_name());
  row.description = option.get_description();
  row.default_text = option.get_default_str();
  return row;
}

CommandRow command_row(const CLI::App& app) {
  CommandRow row{.name = app.get_name(), .description = app.get_description(), .positionals = {}, .options = {}};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;  // --help hides it
    (option->get_positional() ? row.positionals : row.options).push_back(option_row(*option));
  }
  return row;
}

}  // namespace

bool CommandRow::takes_scenario() const {
  return std::any_of(positionals.begin(), positionals.end(),
                     [](const OptionRow& positional) { return positional.name == "SCENARIO"; });
}

CommandTable command_table(const CLI::App& app) {
  CommandTable table{.program = app.get_name(), .itself = command_row(app), .commands = {}};
  table.itself.name.clear();
  for (const CLI::App* command : app.get_subcommands({})) table.commands.push_back(command_row(*command));
  return table;
}

}  // namespace ballast
