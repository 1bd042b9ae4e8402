"""tools/setup.sh and what it builds for tools/run: levels of configuration, progress, failures, and the run-only build."""
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ["BALLAST_ROOT"])
BIN = Path(os.environ["BALLAST_BIN"])
CMAKE = os.environ["BALLAST_CMAKE"]


class SetupTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def shell(self, script, stdin="", **environment):
        """Runs a script after tools/setup.sh, with `root` set to the test's folder."""
        return subprocess.run(["bash", "-c", f"set -euo pipefail\n. '{ROOT}/tools/setup.sh'\nroot='{self.folder}'\n{script}"],
                              input=stdin, capture_output=True, text=True, check=False, env={**os.environ, **environment})

    def program(self, name, text):
        path = self.folder / name
        path.write_text("#!/bin/sh\n" + text)
        path.chmod(0o755)

    def test_a_build_serves_its_own_level_and_those_below(self):
        (self.folder / "build").mkdir()
        (self.folder / "build/build.ninja").touch()
        for run_only, tests, serves in (("ON", "OFF", ["run"]), ("OFF", "OFF", ["run", "tools"]),
                                        ("OFF", "ON", ["run", "tools", "tests"])):
            (self.folder / "build/CMakeCache.txt").write_text(
                f"BALLAST_RUN_ONLY:BOOL={run_only}\nBALLAST_TESTS:BOOL={tests}\n")
            served = [level for level in ("run", "tools", "tests") if self.shell(f"configured {level}").returncode == 0]
            self.assertEqual(served, serves)

    def test_progress_is_reported_in_fifths_and_other_output_passes(self):
        lines = ["dlstatus:1:50:x", "Unpacking a", "pmstatus:a:10.5:x", "pmstatus:a:21:x", "pmstatus:b:30:x",
                 "pmstatus:lib:c:95:x", "pmstatus:c:100.0:x"]
        done = self.shell("apt_progress Installing", stdin="\n".join(lines) + "\n")
        self.assertEqual(done.stdout, "Unpacking a\npmstatus:lib:c:95:x\n")
        self.assertEqual(done.stderr, "Installing: 20 %\nInstalling: 100 %\n")

    def test_a_failed_installation_shows_the_messages_of_apt(self):
        self.program("apt-get", 'test "$1" = update || { echo "pmstatus:a:50:x"; echo "E: no such package"; exit 100; }')
        self.program("dpkg-query", "exit 1")
        self.program("sudo", 'exec "$@"')
        done = self.shell("install_packages nonesuch; echo on", PATH=f"{self.folder}:{os.environ['PATH']}")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("E: no such package", done.stderr)
        self.assertIn("could not be installed", done.stderr)

    def test_a_failed_build_shows_the_messages_of_the_compiler(self):
        self.program("ninja", 'echo "[1/2] Building a"; echo "FAILED: b"; echo "b.cpp: error"; exit 1')
        done = self.shell("configure() { :; }\nbuild run ballast-run; echo on", PATH=f"{self.folder}:{os.environ['PATH']}")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertEqual(done.stderr, "Building ...\nBuilding: 40 %\nFAILED: b\nb.cpp: error\n"
                         "The build failed; see the messages above.\n")

    def test_a_run_needs_no_other_command(self):
        """The run-only build has `ballast-run` and a script in the place of `ballast`, which builds the rest when called."""
        subprocess.run([CMAKE, "-S", ROOT, "-B", self.folder / "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                        "-DBALLAST_RUN_ONLY=ON", "-DBALLAST_TESTS=OFF"], check=True, capture_output=True)
        steps = subprocess.run(["ninja", "-C", self.folder / "build", "-t", "commands", "ballast-run"], check=True,
                               capture_output=True, text=True).stdout
        self.assertIn("run_command.cpp", steps)
        for other in ("check_command", "integrators", "soak", "doctor", "processes"):
            self.assertNotIn(other, steps)
        script = self.folder / "build/bin/ballast"
        self.assertTrue(os.access(script, os.X_OK))
        self.assertIn(f"'{ROOT}/tools/build'\nexec '{script}' \"$@\"\n", script.read_text())

    def test_ballast_run_is_the_run_command_of_ballast(self):
        for name in ("ballast", "ballast-run"):
            subprocess.run([BIN / name, "run", "paper_ball", "--set", "duration=0.2", "--quiet", "--out", name],
                           cwd=self.folder, check=True, timeout=120)
        self.assertEqual((self.folder / "ballast/run.lcmlog").read_bytes(),
                         (self.folder / "ballast-run/run.lcmlog").read_bytes())


if __name__ == "__main__":
    unittest.main()
