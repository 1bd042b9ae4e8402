#include "tools/ballast/completion_script.h"

#include <fmt/format.h>

namespace ballast {
namespace {

// `text` inside single quotes of a POSIX shell.
std::string in_quotes(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out;
}

// The same where zsh's _arguments gives brackets and colons a meaning.
std::string in_specification(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '[' || c == ']' || c == ':' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return in_quotes(out);
}

// The same in fish, whose single quotes know \' and \\.
std::string in_fish(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\'' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return out;
}

std::string option_names(const CommandRow& command) {
  std::string names;
  for (const OptionRow& option : command.options) names += (names.empty() ? "" : " ") + option.name;
  return names;
}

std::string zsh_option(const OptionRow& option) {
  std::string spec = option.repeatable ? "*" : "";
  spec += option.name + (option.takes_value ? "=" : "") + "[" + in_specification(option.description) + "]";
  if (!option.takes_value) return spec;
  spec += ":value:";
  return spec + (option.choices.empty() ? "_files" : fmt::format("({})", fmt::join(option.choices, " ")));
}

std::string zsh_positional(const OptionRow& positional, const std::vector<std::string>& scenarios) {
  const std::string place = positional.repeatable ? "*" : "";
  if (!positional.choices.empty())
    return fmt::format("{}:{}:({})", place, positional.name, fmt::join(positional.choices, " "));
  if (positional.name != "SCENARIO") return fmt::format("{}:{}:_files", place, positional.name);
  return fmt::format("{}:SCENARIO:_alternative \"names:scenario:({})\" \"files:file:_files\"", place,
                     fmt::join(scenarios, " "));
}

}  // namespace

std::string bash_completion(const CommandTable& table, const std::vector<std::string>& scenarios) {
  std::string commands, options, values, words;
  for (const CommandRow& command : table.commands) {
    commands += (commands.empty() ? "" : " ") + command.name;
    options += fmt::format("    {}) options='{}' ;;\n", command.name, option_names(command));
    for (const OptionRow& option : command.options) {
      if (!option.takes_value) continue;
      values += fmt::format("    {}:{}) value=yes words='{}' ;;\n", command.name, option.name,
                            fmt::join(option.choices, " "));
    }
    for (const OptionRow& positional : command.positionals) {
      if (!positional.choices.empty())
        words += fmt::format("    {}) words='{}' ;;\n", command.name, fmt::join(positional.choices, " "));
    }
    if (command.takes_scenario())
      words += fmt::format("    {}) words='{}' ;;\n", command.name, fmt::join(scenarios, " "));
  }
  // Where COMPREPLY stays empty, `complete -o default` completes names of files.
  return fmt::format(R"(# Completion of {0} for bash, made by `{0} completion bash`.
_{0}() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} command=${{COMP_WORDS[1]}}
  local options='' words='' value=''
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W '{1} {2}' -- "$word")
    return
  fi
  # bash makes three words of --option=value.
  if [[ $word == = ]]; then word=''; elif [[ $before == = ]]; then before=${{COMP_WORDS[COMP_CWORD - 2]}}; fi
  case $command in
{3}  esac
  case $command:$before in
{4}  esac
  if [[ ! $value && $word != -* ]]; then
    case $command in
{5}    esac
  elif [[ ! $value ]]; then
    words=$options
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}}
complete -o bashdefault -o default -F _{0} {0}
)",
                     table.program, commands, option_names(table.itself), options, values, words);
}

std::string zsh_completion(const CommandTable& table, const std::vector<std::string>& scenarios) {
  std::string commands, cases;
  for (const CommandRow& command : table.commands) {
    commands += fmt::format("    '{}:{}'\n", command.name, in_specification(command.description));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const OptionRow& option : command.options) cases += fmt::format(" \\\n        '{}'", zsh_option(option));
    for (const OptionRow& positional : command.positionals)
      cases += fmt::format(" \\\n        '{}'", zsh_positional(positional, scenarios));
    cases += "\n      ;;\n";
  }
  return fmt::format(R"(#compdef {0}
# Completion of {0} for zsh, made by `{0} completion zsh`.
_{0}() {{
  local -a commands=(
{1}  )
  if ((CURRENT == 2)); then
    _describe command commands
    compadd -- {2}
    return
  fi
  shift words
  ((CURRENT--))
  case $words[1] in
{3}  esac
}}
if [[ $funcstack[1] == _{0} ]]; then _{0} "$@"; else compdef _{0} {0}; fi
)",
                     table.program, commands, option_names(table.itself), cases);
}

std::string fish_completion(const CommandTable& table, const std::vector<std::string>& scenarios) {
  std::string text = fmt::format("# Completion of {0} for fish, made by `{0} completion fish`.\n", table.program);
  const std::string begin = fmt::format("complete -c {}", table.program);
  for (const OptionRow& option : table.itself.options)
    text += fmt::format("{} -n __fish_use_subcommand -l {} -d '{}'\n", begin, option.name.substr(2),
                        in_fish(option.description));
  for (const CommandRow& command : table.commands) {
    text += fmt::format("{} -n __fish_use_subcommand -f -a {} -d '{}'\n", begin, command.name,
                        in_fish(command.description));
    const std::string in_command = fmt::format("{} -n '__fish_seen_subcommand_from {}'", begin, command.name);
    for (const OptionRow& option : command.options) {
      text += fmt::format("{} -l {}", in_command, option.name.substr(2));
      if (!option.choices.empty()) text += fmt::format(" -x -a '{}'", fmt::join(option.choices, " "));
      if (option.takes_value && option.choices.empty()) text += " -r";
      text += fmt::format(" -d '{}'\n", in_fish(option.description));
    }
    for (const OptionRow& positional : command.positionals) {
      if (!positional.choices.empty())
        text += fmt::format("{} -a '{}'\n", in_command, fmt::join(positional.choices, " "));
    }
    if (command.takes_scenario()) text += fmt::format("{} -a '{}'\n", in_command, fmt::join(scenarios, " "));
  }
  return text;
}

}  // namespace ballast
