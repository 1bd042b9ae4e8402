#include "tools/ballast/manual_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace ballast {
namespace {

// `text` as roff shows it unchanged.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
  return out.starts_with('.') || out.starts_with('\'') ? "\\&" + out : out;
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

std::string head(const std::string& page, const std::string& version, const std::string& description) {
  return fmt::format(".TH {0} 1 \"\" \"ballast {1}\"\n.SH NAME\n{2} \\- {3}\n.SH SYNOPSIS\n", roff(upper(page)),
                     version, roff(page), roff(description));
}

// The word that stands for an option's value: the form at the start of its description, or its kind.
std::string value_word(const OptionRow& option) {
  if (!option.choices.empty()) return fmt::format("{}", fmt::join(option.choices, "|"));
  const std::string form = option.description.substr(0, option.description.find(": "));
  const bool is_form = std::none_of(form.begin(), form.end(), [](unsigned char c) { return std::islower(c) != 0; });
  return is_form && !form.empty() ? form : "VALUE";
}

std::string paragraphs(const std::vector<OptionRow>& options) {
  std::string text;
  for (const OptionRow& option : options) {
    std::string name = option.short_name;
    if (!option.name.empty()) name += (name.empty() ? "" : ", ") + option.name;
    text += fmt::format(".TP\n\\fB{}\\fR{}\n{}{}\n", roff(name),
                        option.takes_value && option.name.starts_with('-') ? " " + roff(value_word(option)) : "",
                        roff(option.description),
                        option.default_text.empty() ? "" : fmt::format(" [default: {}]", roff(option.default_text)));
  }
  return text;
}

}  // namespace

std::string command_manual(const CommandTable& table, const CommandRow& command, const std::string& version) {
  std::string text = head(table.program + "-" + command.name, version, command.description);
  text += fmt::format("\\fB{} {}\\fR", roff(table.program), roff(command.name));
  for (const OptionRow& positional : command.positionals) {
    const std::string word = roff(positional.name) + (positional.repeatable ? "..." : "");
    text += positional.required ? " " + word : " [" + word + "]";
  }
  text += " [OPTION]...\n";
  if (!command.positionals.empty()) text += ".SH ARGUMENTS\n" + paragraphs(command.positionals);
  text += ".SH OPTIONS\n" + paragraphs(command.options);
  text += fmt::format(".SH SEE ALSO\n\\fB{}\\fR(1)\n", roff(table.program));
  return text;
}

std::string program_manual(const CommandTable& table, const std::string& version) {
  std::string text = head(table.program, version, table.itself.description);
  text += fmt::format("\\fB{0}\\fR COMMAND [ARGUMENT]... [OPTION]...\n.br\n\\fB{0} \\-\\-version\\fR\n.SH COMMANDS\n",
                      roff(table.program));
  for (const CommandRow& command : table.commands) {
    text += fmt::format(".TP\n\\fB{}\\fR\n{}\n", roff(command.name), roff(command.description));
  }
  text += ".SH OPTIONS\n" + paragraphs(table.itself.options);
  text +=
      ".SH EXIT STATUS\n"
      "0 completed, 1 bad usage or scenario, 2 could not be done, 3 the envelope was violated or something tripped.\n"
      "4 to 8 belong to runs in QEMU and to replays.\n.SH SEE ALSO\n";
  for (const CommandRow& command : table.commands) {
    text += fmt::format("\\fB{}\\-{}\\fR(1){}\n", roff(table.program), roff(command.name),
                        &command == &table.commands.back() ? "" : ",");
  }
  return text;
}

}  // namespace ballast
