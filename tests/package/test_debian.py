"""The Debian packages: what they hold, what they need, and that their files run where they are unpacked.

Installing them in a bare Debian 12 needs root and a network; tools/docs/install.md has the commands.
"""
import json
import re
import subprocess
import unittest
from pathlib import Path

from installation import BUILD, CMAKE, VERSION, Installed

CPACK = Path(CMAKE).with_name("cpack")


class Packages(Installed):
    components = ()

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        subprocess.run([CPACK, "--config", BUILD / "CPackConfig.cmake", "-B", cls.scratch / "packages"], cwd=cls.scratch,
                       check=True, capture_output=True)
        files = list((cls.scratch / "packages").glob("*.deb"))
        cls.packages = {file.name.split("_")[0]: file for file in files}

    def field(self, package, name):
        return subprocess.run(["dpkg-deb", "-f", self.packages[package], name], capture_output=True, text=True,
                              check=True).stdout.strip()

    def files(self, package):
        """The files of a package, without folders."""
        said = subprocess.run(["dpkg-deb", "-c", self.packages[package]], capture_output=True, text=True, check=True).stdout
        lines = [line.split(maxsplit=5) for line in said.splitlines()]
        self.assertEqual({owner for _, owner, *_ in lines}, {"root/root"})
        self.assertLessEqual({mode[4:] for mode, *_ in lines}, {"r-xr-x", "r--r--"})
        return {line[5] for line in lines if not line[0].startswith("d")}

    def test_three_packages_of_this_version_without_a_common_file(self):
        self.assertLessEqual({"ballast", "ballast-dev", "python3-ballast"}, set(self.packages))
        seen = set()
        for package in self.packages:
            self.assertEqual(self.field(package, "Version"), VERSION)
            files = self.files(package)
            self.assertEqual(files & seen, set())
            self.assertTrue(all(name.startswith("./usr/") for name in files))
            self.assertFalse([name for name in files if "__pycache__" in name or name.endswith(".pyc")])
            seen |= files

    def test_packages_need_what_they_use(self):
        # Libraries that the program is linked with, the one it loads when it needs it, and what its scripts import.
        needed = self.field("ballast", "Depends")
        for name in ("libc6", "libfmt9", "liblcm1", "libtomlplusplus3", "libnetcdf19", "python3-numpy"):
            self.assertRegex(needed, rf"\b{name}\b")
        self.assertNotIn("-dev", needed)
        self.assertIn(f"ballast (= {VERSION})", self.field("python3-ballast", "Depends"))
        self.assertRegex(self.field("python3-ballast", "Depends"), r"python3 \(>= 3\.\d+\), python3 \(<< 3\.\d+\), python3-numpy")
        for name in ("libeigen3-dev", "libfmt-dev", "libtomlplusplus-dev", "nlohmann-json3-dev", "liblcm-dev", "libglib2.0-dev"):
            self.assertIn(name, self.field("ballast-dev", "Depends"))

    def test_the_unpacked_files_run(self):
        root = self.folder / "root"
        for package in ("ballast", "python3-ballast"):
            subprocess.run(["dpkg-deb", "-x", self.packages[package], root], check=True)
        self.run_in_folder(root / "usr/bin/ballast", "run", "paper_ball", "--quiet", "--out", "run")
        summary = json.loads((self.folder / "run/summary.json").read_text())
        self.assertEqual(summary["end"]["reason"], "completed")
        said = self.run_in_folder("/usr/bin/python3", "-B", "-s", "-c", "import ballast; print(ballast.friction('paper_ball').keys())",
                                  PYTHONPATH=str(root / "usr/lib/python3/dist-packages"))
        self.assertIn("parts", said)

    def test_no_file_names_the_build_tree(self):
        root = self.folder / "root"
        for package in ("ballast-dev", "python3-ballast"):
            subprocess.run(["dpkg-deb", "-x", self.packages[package], root], check=True)
        for path in root.rglob("*"):
            if path.suffix in (".cmake", ".py", ".h", ".hpp", ".txt"):
                self.assertNotRegex(path.read_text(), re.escape(str(BUILD)), path)


if __name__ == "__main__":
    unittest.main()
