"""Manual pages and shell completion name every command and option, and bash completes command lines."""
import os
import pty
import re
import select
import shutil
import subprocess
import time
import unittest

from command_help import commands_in, options_in
from installation import Installed


class Shell(Installed):
    components = ("programs",)

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        share = cls.prefix / "share"
        cls.man = share / "man/man1"
        cls.scripts = {"bash": share / "bash-completion/completions/ballast", "zsh": share / "zsh/vendor-completions/_ballast",
                       "fish": share / "fish/vendor_completions.d/ballast.fish"}

    def help_of(self, *command):
        return self.run_in_folder("ballast", *command, "--help")

    def commands(self):
        found = commands_in(self.help_of())
        self.assertGreater(len(found), 10)
        return found

    def options(self, command):
        return options_in(self.help_of(command))

    def test_a_manual_page_for_each_command_with_each_option(self):
        commands = self.commands()
        self.assertEqual({page.name for page in self.man.iterdir()}, {"ballast.1", *(f"ballast-{c}.1" for c in commands)})
        program = self.rendered("ballast.1")
        for command in commands:
            with self.subTest(command):
                self.assertRegex(program, rf"(?m)^ +{command}$|^ +{command} ")
                page = self.rendered(f"ballast-{command}.1")
                self.assertIn(f"ballast {command}", page)
                self.assertEqual(set(re.findall(r"^ {7}(?:-h, )?(--[a-z-]+)", page, re.M)), self.options(command))
                for positional in re.findall(r"^  ([A-Z_]+|sweep)\b.*REQUIRED", self.help_of(command), re.M):
                    self.assertIn(positional, page)

    def rendered(self, page):
        """The page as text. A warning of groff fails the test."""
        done = subprocess.run(["groff", "-man", "-Tascii", "-ww", "-P-c", "-P-b", "-P-u", self.man / page], capture_output=True,
                              text=True, check=True, env={**self.environment, "LC_ALL": "C"})
        self.assertEqual(done.stderr, "", page)
        return done.stdout

    def test_the_command_prints_the_page_that_is_installed(self):
        self.assertEqual(self.run_in_folder("ballast", "manual", "run"), (self.man / "ballast-run.1").read_text())
        self.assertEqual(self.run_in_folder("ballast", "manual"), (self.man / "ballast.1").read_text())
        self.run_in_folder("ballast", "manual", "nonesuch", status=1)

    def test_each_script_has_each_command_and_option(self):
        commands = self.commands()
        for shell, script in self.scripts.items():
            text = script.read_text()
            self.assertEqual(text, self.run_in_folder("ballast", "completion", shell))
            for command in commands:
                with self.subTest(shell=shell, command=command):
                    self.assertRegex(text, rf"\b{command}\b")
                    here = {"bash": rf"(?m)^ +{command}\) options='(.*)'", "zsh": rf"(?s)\n    {command}\)\n(.*?);;",
                            "fish": rf"(?m)^.*__fish_seen_subcommand_from {command}'.*$"}[shell]
                    part = "\n".join(match.group(0) for match in re.finditer(here, text))
                    found = set(re.findall(r"-l ([a-z-]+)", part)) if shell == "fish" else \
                        {name[2:] for name in re.findall(r"(?<![\w-])--[a-z-]+(?=[ ='\[]|$)", part)}
                    self.assertEqual({name[2:] for name in self.options(command)} - found, set())

    def complete(self, *words):
        """Words that bash offers for the last of these words."""
        line = " ".join(f"'{word}'" for word in words)
        script = (f". '{self.scripts['bash']}'\nCOMP_WORDS=({line})\nCOMP_CWORD={len(words) - 1}\n_ballast\n"
                  'printf "%s\\n" "${COMPREPLY[@]}"\n')
        return self.run_in_folder("bash", "-c", script).split()

    def test_bash_completes(self):
        self.assertEqual(self.complete("ballast", "ru"), ["run"])
        self.assertEqual(self.complete("ballast", "--v"), ["--version"])
        self.assertEqual(self.complete("ballast", "run", "paper_b"), ["paper_ball"])
        self.assertEqual(self.complete("ballast", "run", "paper_ball", "--act"), ["--actuation"])
        self.assertEqual(self.complete("ballast", "run", "--actuation", ""), ["prescribed", "stepper", "ideal"])
        self.assertEqual(self.complete("ballast", "run", "--actuation", "=", "st"), ["stepper"])
        self.assertEqual(self.complete("ballast", "run", "--actuation", "="), ["prescribed", "stepper", "ideal"])
        self.assertEqual(self.complete("ballast", "operate", "re"), ["reset"])
        self.assertEqual(self.complete("ballast", "run", "--out", "paper"), [])  # bash then offers files

    def test_a_terminal_completes(self):
        """A bash on a terminal, where somebody types half a word and presses the tab key."""
        terminal, its_end = pty.openpty()
        with subprocess.Popen(["bash", "--norc", "--noprofile", "-i"], cwd=self.folder, stdin=its_end, stdout=its_end,
                              stderr=its_end, start_new_session=True,
                              env={**self.environment, "TERM": "dumb", "PS1": "> ", "INPUTRC": "/dev/null"}) as bash:
            os.close(its_end)
            os.write(terminal, f". '{self.scripts['bash']}'\necho read''y\n".encode())
            self.read_until(terminal, b"\nready")
            os.write(terminal, b"ballast run paper_b\t--act\t")
            self.read_until(terminal, b"ballast run paper_ball --actuation ")
            bash.kill()
        os.close(terminal)

    def read_until(self, terminal, wanted):
        said, until = b"", time.monotonic() + 60
        while wanted not in said:
            self.assertLess(time.monotonic(), until, said)
            if select.select([terminal], [], [], 1)[0]:
                said += os.read(terminal, 4096)

    def test_other_shells_read_their_scripts(self):
        for shell in ("zsh", "fish"):
            if shutil.which(shell):
                subprocess.run([shell, "-n", self.scripts[shell]], check=True)


if __name__ == "__main__":
    unittest.main()
