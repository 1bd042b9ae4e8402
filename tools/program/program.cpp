#include "tools/program/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <iostream>

#include "sim/scenario/reader.h"
#include "tools/program/places.h"
#include "tools/program/subprocess.h"

namespace ballast::program {
namespace {

volatile std::sig_atomic_t caught_signal = 0, sent_by_parent = 0;

// One wish to stop can arrive twice: timeout(1), for one, sends its signal to the program and then to the whole group.
constexpr std::int64_t kSameWishNs = 200'000'000;
volatile std::int64_t asked_at_ns = 0;

void on_signal(int number, siginfo_t* info, void*) {
  sent_by_parent = info->si_code == SI_USER && info->si_pid == getppid();
  caught_signal = number;
  if (number == SIGHUP) return;  // a closed terminal sends one, and its shell sends another
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  const std::int64_t now_ns = now.tv_sec * 1'000'000'000LL + now.tv_nsec;
  if (asked_at_ns == 0) {
    asked_at_ns = now_ns;
  } else if (now_ns - asked_at_ns > kSameWishNs) {
    // A second signal kills, in case the first takes too long: as soon as this handler returns.
    signal(number, SIG_DFL);
    raise(number);
  }
}

// Opens standard files that are closed. Otherwise the next file opened, a bus or a log, would become standard output.
// Printing to a file that was closed fails.
void keep_standard_files() {
  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(file, F_GETFD) < 0) static_cast<void>(open("/dev/null", file == STDIN_FILENO ? O_WRONLY : O_RDONLY));
  }
}

// Checks a seed. As in a scenario, the limit is that of TOML's integers, 2^63 - 1.
CLI::Validator seed_number() {
  const auto check = [](std::string& text) -> std::string {
    std::int64_t value = 0;
    const char* end = text.data() + text.size();
    const auto [parsed, error] = std::from_chars(text.data(), end, value);
    if (error == std::errc{} && parsed == end && value >= 0) return {};
    return fmt::format("{} is no seed; allowed: an integer from 0 to 9223372036854775807", text);
  };
  return {check, ""};
}

std::string did_you_mean(const std::string& word, const std::vector<std::string>& names) {
  const std::string near = sim::nearest(word, names);
  return near.empty() ? "" : fmt::format("; did you mean {}?", near);
}

std::string unknown_scenario(const std::string& name) {
  const std::vector<std::string> names = shipped_names();
  std::string text = name + ": neither a file nor the name of a shipped scenario";
  if (!names.empty()) text += fmt::format(" ({})", fmt::join(names, ", "));
  return text + did_you_mean(std::filesystem::path(name).stem().string(), names);
}

std::string unknown_command(const std::string& word, const CLI::App& app) {
  if (word.starts_with('-')) return word + ": options come after the command; allowed before it: --help, --version";
  if (word == "help")
    return fmt::format("help: no such command; {0} --help and {0} COMMAND --help print help", app.get_name());
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  return fmt::format("{}: no such command; allowed: {}{}", word, fmt::join(names, ", "), did_you_mean(word, names));
}

std::string unexpected_text(const std::string& word, const CLI::App& command, const std::string& name) {
  if (!word.starts_with('-')) return fmt::format("{}: is one word too many; {} --help shows the usage", word, name);
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& known : option->get_lnames()) names.push_back("--" + known);
  }
  return fmt::format("{}: no such option{}; {} --help lists them", word, did_you_mean(word, names), name);
}

// The kind of an option's value. A description such as "KEY=VALUE: replace a value" begins with its form.
std::string kind_of_value(const CLI::App& command, const std::string& option_name) {
  const CLI::Option* option = command.get_option_no_throw(option_name);
  const std::string type = option == nullptr ? "" : option->get_type_name();
  const std::string description = option == nullptr ? "" : option->get_description();
  const std::string form = description.substr(0, description.find(": "));
  const bool is_form = std::none_of(form.begin(), form.end(), [](unsigned char c) { return std::islower(c) != 0; });
  if (is_form && !form.empty()) return form;
  return type.starts_with("FLOAT")                             ? "a number"
         : type.starts_with("INT") || type.starts_with("UINT") ? "a whole number"
                                                               : "a value";
}

// Says what is wrong with the command line: option, value, what is allowed. CLI11's own text is kept where that is the
// text of a check of this program.
std::string usage_error_text(const CLI::ParseError& error, const CLI::App& app) {
  const std::vector<CLI::App*> commands = app.get_subcommands();
  const std::vector<std::string> rest = app.remaining(true);
  const bool lacks_command = app.get_require_subcommand_min() > 0 && commands.empty();
  if (lacks_command && !rest.empty()) return unknown_command(rest.front(), app);
  if (lacks_command) return "a command is missing; " + app.get_name() + " --help lists them";
  const CLI::App& command = commands.empty() ? app : *commands.back();
  const std::string name = commands.empty() ? app.get_name() : app.get_name() + " " + command.get_name();
  const std::string text = error.what();
  switch (static_cast<CLI::ExitCodes>(error.get_exit_code())) {
    case CLI::ExitCodes::ExtrasError:
      return rest.empty() ? text : unexpected_text(rest.front(), command, name);
    case CLI::ExitCodes::RequiredError:  // "NAME is required"
      return fmt::format("{}: is missing; {} --help shows the usage", text.substr(0, text.find(' ')), name);
    case CLI::ExitCodes::ArgumentMismatch: {  // "NAME: 1 required TYPE missing" or "NAME: At Most 1 required .."
      const std::string option = text.substr(0, text.find(':'));
      if (text.find("At Most") != std::string::npos) return option + ": is given more than once; allowed: once";
      return fmt::format("{}: its value is missing; allowed: {}", option, kind_of_value(command, option));
    }
    case CLI::ExitCodes::ConversionError: {  // "Could not convert: NAME = VALUE"
      const std::size_t begin = text.find(": "), middle = text.find(" = ");
      if (begin == std::string::npos || middle == std::string::npos) return text;
      const std::string option = text.substr(begin + 2, middle - begin - 2), kind = kind_of_value(command, option);
      return fmt::format("{}: {} is not allowed; allowed: {}", option, text.substr(middle + 3), kind);
    }
    default:
      return text;
  }
}

}  // namespace

CLI::Validator positive_finite() {
  const auto check = [](std::string& text) -> std::string {
    double value = 0;
    const bool number = CLI::detail::lexical_cast(text, value);
    if (number && std::isfinite(value) && value > 0) return {};
    return fmt::format("{} is {}; allowed: a finite number > 0", text, number ? "out of range" : "no number");
  };
  return {check, ""};
}

CLI::Validator one_of(const std::vector<std::string>& names) {
  const auto check = [names](std::string& text) -> std::string {
    if (std::find(names.begin(), names.end(), text) != names.end()) return {};
    return fmt::format("{} is unknown; allowed: {}{}", text, fmt::join(names, ", "), did_you_mean(text, names));
  };
  return {check, fmt::format("{{{}}}", fmt::join(names, ","))};
}

CLI::Validator whole_number(int low, int high) {
  const auto check = [low, high](std::string& text) -> std::string {
    int value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return {};
    const std::size_t sign = text.starts_with('-') || text.starts_with('+') ? 1 : 0;
    const bool is_whole = text.size() > sign && text.find_first_not_of("0123456789", sign) == std::string::npos;
    return fmt::format("{} {}; allowed: a whole number from {} to {}", text,
                       is_whole ? "is out of range" : "is no whole number", low, high);
  };
  return {check, fmt::format("{} to {}", low, high)};
}

CLI::Validator not_empty() {
  const auto check = [](std::string& text) { return text.empty() ? std::string("is empty") : std::string(); };
  return {check, ""};
}

void add_scenario_options(CLI::App& app, ScenarioOptions& options) {
  app.add_option("SCENARIO", options.scenario, "a scenario file, or the name of a shipped scenario")
      ->required()
      ->check(not_empty());
  app.add_option("--set", options.set, "KEY=VALUE: replace a value of the scenario, e.g. mass.2.mass=60; repeatable")
      ->allow_extra_args(false)  // otherwise it would take SCENARIO as a second value
      ->check(not_empty());
  app.add_option(
         "--fault", options.fault,
         "KIND@TIME[:PARAM]: inject a fault, e.g. motor_stall@1.5:mass=0; repeatable; `ballast faults` lists the "
         "kinds")
      ->allow_extra_args(false)
      ->check(not_empty());
  app.add_option("--actuation", options.actuation, "prescribed, stepper or ideal; default: the scenario's")
      ->check(one_of({"prescribed", "stepper", "ideal"}));
  app.add_option("--seed", options.seed, "seed of all random numbers; default: the scenario's")->check(seed_number());
}

void add_bus_options(CLI::App& app, BusOptions& options) {
  app.add_option("--lcm", options.url, "URL of the LCM bus")->check(not_empty())->capture_default_str();
  app.add_option("--start-timeout", options.start_timeout_s, "seconds to wait for the first tick")
      ->check(positive_finite())
      ->capture_default_str();
  app.add_option("--peer-timeout", options.peer_timeout_s, "seconds of silence after which a peer is lost")
      ->check(positive_finite())
      ->capture_default_str();
}

std::string default_firmware(const std::string& board) {
  const std::string name = "ballast-" + board + ".elf";
  const std::filesystem::path data = installed_data();
  return data.empty() ? beside_this_program("").parent_path().parent_path() / board / "bin" / name
                      : data / "elf" / name;
}

namespace {

// An option for a number whose value is empty; CLI11 takes that for 0. Null: there is none.
const CLI::Option* empty_number(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    const auto& values = option->results();
    const bool number = option->get_type_name().find("TEXT") == std::string::npos;
    if (number && std::find(values.begin(), values.end(), "") != values.end()) return option;
  }
  for (const CLI::App* command : app.get_subcommands()) {
    if (const CLI::Option* option = empty_number(*command)) return option;
  }
  return nullptr;
}

}  // namespace

std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  keep_standard_files();
  const auto version = [&app] { return app.get_name() + " " + version_text(); };
  app.set_version_flag("--version", version, "print the version with its commit and exit");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 takes a request for help or the version for good, whatever stands beside it.
    const bool asks = error.get_exit_code() == 0;
    if (asks && (app.remaining().empty() || !app.get_subcommands().empty())) {
      app.exit(error);
      return after_output(app.get_name(), kExitCompleted);
    }
    complain(app.get_name(), usage_error_text(error, app));
    return kExitUsage;
  }
  if (const CLI::Option* option = empty_number(app)) {
    complain(app.get_name(), option->get_name() + ": is empty; allowed: a number");
    return kExitUsage;
  }
  return std::nullopt;
}

std::optional<int> parse_peer(CLI::App& app, int argc, char** argv, PeerOptions& options) {
  add_scenario_options(app, options.scenario_options);
  add_bus_options(app, options.bus);
  if (const auto exit_status = parse(app, argc, argv)) return exit_status;
  options.scenario = load_scenario(options.scenario_options);
  return options.scenario ? std::nullopt : std::optional(kExitUsage);
}

std::filesystem::path find_scenario(const std::string& file_or_name) {
  std::string why;
  std::filesystem::path file = scenario_file(file_or_name, why);
  if (file.empty()) std::cerr << why << '\n';
  return file;
}

std::optional<sim::Scenario> load_scenario(const ScenarioOptions& options, std::vector<sim::ScenarioError>* warnings) {
  const std::filesystem::path file = find_scenario(options.scenario);
  if (file.empty()) return std::nullopt;
  std::vector<std::string> overrides = options.set;
  if (!options.actuation.empty()) overrides.push_back("run.actuation=" + options.actuation);
  if (options.seed) overrides.push_back("seed=" + std::to_string(*options.seed));
  sim::ScenarioResult result = sim::read_scenario(file, overrides, options.fault);
  for (const sim::ScenarioError& error : result.errors) std::cerr << sim::to_string(error) << '\n';
  if (warnings != nullptr) *warnings = result.warnings;
  if (result.ok()) return std::move(result.scenario);
  // If two values do not fit each other, the error names one of them, which may not be the one that --set has changed.
  const auto is_named = [&overrides](const sim::ScenarioError& error) {
    return error.source.starts_with("--fault") || error.key.empty() ||
           std::any_of(overrides.begin(), overrides.end(), [&error](const std::string& set) {
             return (error.key + ".").starts_with(set.substr(0, set.find('=')) + ".");
           });
  };
  const auto& errors = result.errors;
  if (!overrides.empty() && !std::all_of(errors.begin(), errors.end(), is_named) && sim::read_scenario(file).ok()) {
    std::string changed;
    for (const std::string& set : options.set) changed += " --set " + shell_word(set);
    if (!options.actuation.empty()) changed += " --actuation " + options.actuation;
    std::cerr << fmt::format("{} is valid without{}\n", file.string(), changed);
  }
  return std::nullopt;
}

std::vector<std::string> shipped_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(shipped_scenarios(), error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".toml") names.push_back(entry->path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string scenario_file(const std::string& name_or_path, std::string& why) {
  const std::filesystem::path file = sim::find_scenario(name_or_path, shipped_scenarios());
  if (file.empty()) why = unknown_scenario(name_or_path);
  return file.string();
}

std::string ballast_as_typed(bool absolute) {
  const std::filesystem::path self(program_invocation_name);  // argv[0]
  if (!used_programs_folder().empty()) return shell_word(beside_this_program("ballast"));
  if (!self.has_parent_path()) return "ballast";  // found in PATH
  std::filesystem::path path = self.parent_path() / "ballast";
  std::error_code code;
  if (!std::filesystem::exists(path, code)) path = beside_this_program("ballast");  // started by a link
  return shell_word(absolute ? std::filesystem::absolute(path).lexically_normal() : path);
}

std::string shell_word(const std::string& text) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || std::string_view("/._-+,:@%").find(static_cast<char>(c)) != std::string_view::npos;
  };
  if (!text.empty() && std::all_of(text.begin(), text.end(), plain)) return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string as_typed(const BusOptions& options) {
  const BusOptions defaults;
  std::string text;
  if (options.url != defaults.url) text += " --lcm " + shell_word(options.url);
  if (options.peer_timeout_s != defaults.peer_timeout_s)
    text += " --peer-timeout " + sim::number_text(options.peer_timeout_s);
  return text;
}

void complain(const std::string& program_name, const std::string& text) {
  std::cerr << fmt::format("{}: {}\n", program_name, text);
}

std::string bad_bus(const std::string& url) { return "cannot use the LCM bus " + url; }

int refuse_bus(const std::string& program_name, const std::string& url) {
  complain(program_name,
           fmt::format("{}; {} doctor --lcm {} examines it", bad_bus(url), ballast_as_typed(), shell_word(url)));
  return kExitCouldNotRun;
}

const volatile std::sig_atomic_t* catch_signals() {
  struct sigaction action {};
  action.sa_sigaction = on_signal;
  action.sa_flags = SA_SIGINFO;  // no SA_RESTART: waiting calls return
  for (const int number : {SIGINT, SIGTERM}) sigaction(number, &action, nullptr);
  struct sigaction before {};
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  return &caught_signal;
}

const char* interruption() {
  return sent_by_parent != 0 ? "told to end by the program that started it" : "interrupted";
}

int after_output(const std::string& program_name, int exit_status) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return exit_status;
  std::string text = "standard output could not be written";
  if (errno != 0) text += fmt::format(": {}", std::strerror(errno));  // 0: an earlier write failed
  complain(program_name, text);
  return exit_status == kExitCompleted ? kExitCouldNotRun : exit_status;
}

}  // namespace ballast::program
