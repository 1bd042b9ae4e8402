"""The number both ends of a link compare: it changes with every file a microcontroller's program is made of."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(os.environ["BALLAST_ROOT"])
CMAKE = os.environ["BALLAST_CMAKE"]
BUILDS = [pathlib.Path(build) for build in os.environ["BALLAST_BOARD_BUILDS"].split(":") if build]


def number(root, output):
    subprocess.run(
        [CMAKE, f"-DROOT={root}", f"-DOUTPUT={output}", "-P", ROOT / "hal/target/build_id.cmake"], check=True)
    return output.read_text()


class BuildId(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.scratch.name) / "root"
        for room in ("firmware", "hal", "tools/toolchain"):
            shutil.copytree(ROOT / room, cls.root / room)
        shutil.copy(ROOT / "CMakeLists.txt", cls.root)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def changes(self, name):
        output = pathlib.Path(self.scratch.name) / "id.h"
        before = number(self.root, output)
        path = self.root / name
        content = path.read_bytes()
        try:
            path.write_bytes(content + b"\n")
            return number(self.root, output) != before
        finally:
            path.write_bytes(content)

    def test_changes_with_what_decides(self):
        for name in ("firmware/control/controller.cpp", "firmware/model/types.h", "hal/status.h", "hal/host_link.h",
                     "hal/control_loop.h", "hal/operator_queue.h", "hal/target/messages.h", "hal/target/messages.cpp",
                     "hal/mps2/startup.cpp", "hal/mps2/mps2.ld", "hal/mps2_an500/board.cmake",
                     "hal/mps2_an386/board.cmake", "hal/mps2/CMakeLists.txt", "hal/target/build_id.cmake",
                     "firmware/CMakeLists.txt", "firmware/options.cmake", "CMakeLists.txt",
                     "tools/toolchain/arm-none-eabi.cmake"):
            with self.subTest(name):
                self.assertTrue(self.changes(name))

    def test_changes_with_a_new_board(self):
        output = pathlib.Path(self.scratch.name) / "id.h"
        before = number(self.root, output)
        board = self.root / "hal/another"
        board.mkdir()
        try:
            (board / "board.cmake").write_text("")
            self.assertNotEqual(number(self.root, output), before)
        finally:
            shutil.rmtree(board)

    def test_does_not_change_with_what_is_the_hosts_or_says_nothing(self):
        for name in ("hal/lcm/bus.h", "hal/lockstep/lockstep_board.h", "hal/README.md", "hal/mps2_an500/size.txt"):
            with self.subTest(name):
                self.assertFalse(self.changes(name))

    def test_knows_every_file_the_compiler_read(self):
        """The compiler's own dependency lists of each board's build name every file that the number has to cover."""
        seen = set()
        for build in BUILDS:
            said = subprocess.run(["ninja", "-C", build, "-t", "deps"], check=True, capture_output=True, text=True)
            for line in said.stdout.splitlines():
                if not line.startswith(" "):
                    continue
                path = pathlib.Path(os.path.normpath(build / line.strip()))
                # Files that the build generates follow from its sources. The tests' own programs are no firmware.
                if path.is_relative_to(ROOT) and not any(
                        path.is_relative_to(other) for other in (build.parent, ROOT / "tests")):
                    seen.add(str(path.relative_to(ROOT)))
        self.assertTrue(seen, "no board's firmware has been built")
        for name in sorted(seen):
            with self.subTest(name):
                self.assertTrue((ROOT / name).exists() and self.changes(name))


if __name__ == "__main__":
    unittest.main()
