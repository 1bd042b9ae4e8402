"""Small programs for the microcontroller, linked as the board's is but without a board."""
import os
import subprocess
import sys
import tempfile
import unittest

COMPILER = os.environ["BALLAST_CROSS_CXX"]
TOOLS = os.environ["BALLAST_ELF_TOOLS"]
MACHINE = ["-mthumb", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard"]
FLAGS = MACHINE + ["-std=c++20", "-fno-exceptions", "-fno-rtti", "--specs=nano.specs", "-nostartfiles",
                   "-Wl,-e,main,-Ttext=0x100,--gc-sections", "-Wl,--no-warn-rwx-segments"]


class Folder(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def link(self, sources, *flags, name="program.elf"):
        """sources: {file name: text}. The ELF's path."""
        paths = []
        for file, text in sources.items():
            paths.append(os.path.join(self.folder, file))
            with open(paths[-1], "w", encoding="utf-8") as out:
                out.write(text)
        elf = os.path.join(self.folder, name)
        subprocess.run([COMPILER, *FLAGS, "-O2", *flags, *paths, "-o", elf, "-lm"], check=True, cwd=self.folder)
        return elf

    @staticmethod
    def tool(name, *arguments):
        """Exit status, what it printed, what it complained of."""
        done = subprocess.run([sys.executable, "-B", os.path.join(TOOLS, name), *arguments], capture_output=True,
                              text=True, check=False)
        return done.returncode, done.stdout, done.stderr
