"""An installation of this build in a folder that it was not installed to, and an environment that knows no build tree."""
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ["BALLAST_ROOT"])
BUILD = Path(os.environ["BALLAST_BUILD"])
CMAKE = os.environ["BALLAST_CMAKE"]
VERSION = os.environ["BALLAST_VERSION"]


class Installed(unittest.TestCase):
    """`prefix`: the installation, of the class's `components`. `folder`: an empty folder per test."""

    components = ("programs",)

    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = Path(scratch.name)
        (cls.scratch / "first").mkdir()
        for component in cls.components:
            subprocess.run([CMAKE, "--install", BUILD, "--prefix", cls.scratch / "first", "--component", component],
                           check=True, capture_output=True)
        cls.prefix = cls.scratch / "moved"
        shutil.move(cls.scratch / "first", cls.prefix)
        cls.environment = {"PATH": f"{cls.prefix}/bin:/usr/bin:/bin", "HOME": str(cls.scratch), "LANG": "C.UTF-8"}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def run_in_folder(self, *command, status=0, **environment):
        """The standard output of a command, which must end with this status."""
        done = subprocess.run(command, cwd=self.folder, env={**self.environment, **environment}, capture_output=True,
                              text=True, check=False, timeout=600)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout
