"""Every command of ballast has a page, tools/docs/COMMAND.md, that names each of its options and no others."""
import os
import pathlib
import re
import subprocess
import unittest

DOCS = pathlib.Path(__file__).resolve().parents[2] / "tools/docs"
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


def help_of(*command):
    return subprocess.run([os.environ["BALLAST"], *command, "--help"], capture_output=True, text=True, check=True).stdout


class Commands(unittest.TestCase):
    def test_pages_have_the_options_of_their_commands(self):
        commands = re.findall(r"^  (\w+)  +\S", help_of().split("Subcommands:")[1], re.M)
        self.assertGreater(len(commands), 10)
        of_any = set().union(*(OPTION.findall(help_of(command)) for command in commands))
        for command in commands:
            with self.subTest(command):
                page = (DOCS / f"{command}.md").read_text()
                options = set(re.findall(r"^  (?:-h,)?(--[a-z-]+)", help_of(command), re.M)) - {"--help"}
                # Options of another command may be mentioned in prose, not in a row of the table.
                self.assertEqual(options - set(OPTION.findall(page)), set(), "not on the page")
                rows = set().union(*(OPTION.findall(row) for row in re.findall(r"^\| (`--[^|]*(?:\\\|[^|]*)*)\|", page, re.M)))
                self.assertEqual(rows & of_any - options, set(), "on the page, and no option of this command")
                self.assertEqual(rows - of_any, set(), "on the page, and no option of any command")


if __name__ == "__main__":
    unittest.main()
