"""Commands and options in the text that --help prints."""
import re


def commands_in(text):
    """The commands of the program, in order."""
    return re.findall(r"^  (\w+)  +\S", text.split("Subcommands:")[1], re.M)


def options_in(text):
    """The options of a command, a set."""
    return set(re.findall(r"^  (?:-h,)?(--[a-z-]+)", text, re.M))
