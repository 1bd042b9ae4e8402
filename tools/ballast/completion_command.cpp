// ballast completion: the script by which a shell completes command lines of this program.
#include <iostream>
#include <memory>
#include <string>

#include "tools/ballast/command_table.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/completion_script.h"
#include "tools/program/program.h"

namespace ballast {

std::function<int()> add_completion_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("completion", "Prints a script by which bash, zsh or fish complete command lines");
  auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->check(program::one_of({"bash", "zsh", "fish"}));
  return [&app, shell] {
    const auto script = *shell == "bash" ? bash_completion : *shell == "zsh" ? zsh_completion : fish_completion;
    std::cout << script(command_table(app), program::shipped_names());
    return program::kExitCompleted;
  };
}

}  // namespace ballast
