"""`cmake --install`: programs and Python package work in a folder they were not built for, and leave the same bytes."""
import re
import subprocess
import unittest

from installation import BUILD, ROOT, VERSION, Installed


class Programs(Installed):
    components = ("programs", "python", "cluster")

    def test_a_run_leaves_the_bytes_of_the_build_tree(self):
        self.run_in_folder("ballast", "run", "paper_ball", "--set", "duration=1", "--quiet", "--out", "a")
        subprocess.run([BUILD / "bin/ballast", "run", "paper_ball", "--set", "duration=1", "--quiet", "--out", "b"],
                       cwd=self.folder, check=True)
        for name in ("run.lcmlog", "scenario.toml", "robot.json"):
            self.assertEqual((self.folder / "a" / name).read_bytes(), (self.folder / "b" / name).read_bytes(), name)

    def test_the_version_is_that_of_the_build_tree(self):
        said = self.run_in_folder("ballast", "--version")
        self.assertRegex(said, rf"^ballast {re.escape(VERSION)} \(commit ([0-9a-f]{{12}}|unknown)\)\n$")
        self.assertEqual(said, subprocess.run([BUILD / "bin/ballast", "--version"], capture_output=True, text=True,
                                              check=True).stdout)

    def test_pages_that_help_names_are_installed(self):
        named = set()
        for path in self.prefix.rglob("dist-packages/ballast/*.py"):
            named |= set(re.findall(r"tools/docs/[\w.]+\.(?:md|json)", path.read_text()))
        self.assertGreater(len(named), 5)
        for name in named:
            self.assertTrue((self.prefix / "share/doc/ballast" / name).exists(), name)

    def test_every_scenario_of_the_sources_ships(self):
        shipped = {path.name for path in (self.prefix / "share/ballast/scenarios").iterdir()}
        self.assertEqual(shipped, {path.name for path in (ROOT / "sim/scenarios").glob("*.toml")})

    def test_programs_find_what_they_start(self):
        self.run_in_folder("ballast", "run", "paper_ball", "--set", "duration=0.3", "--processes", "--quiet", "--out", "a",
                           "--lcm", "udpm://239.255.76.67:7691?ttl=0")
        self.run_in_folder("ballast", "run", "paper_ball", "--set", "duration=0.3", "--set", "mass.1.mass=1.2", "--pictures",
                           "--quiet", "--out", "b", "--actuation", "prescribed")
        self.assertTrue((self.folder / "b/path.png").exists())
        self.run_in_folder("ballast", "export", "a", "--csv", "tables")
        self.assertTrue((self.folder / "tables/BALLAST_CONTACT.csv").exists())
        # The packages that the page draws with are fetched once per user; here they are those of the build tree.
        self.run_in_folder("ballast", "compare", "a", "b", XDG_CACHE_HOME=self.cache())
        self.run_in_folder("ballast", "report", "a", XDG_CACHE_HOME=self.cache())
        self.assertTrue((self.folder / "a/report.html").exists())

    def cache(self):
        cache = self.folder / "cache"
        if not cache.exists():
            cache.mkdir()
            (BUILD / "packages").mkdir(exist_ok=True)
            (cache / "ballast").symlink_to(BUILD / "packages")
        return str(cache)

    def test_a_sweep_finds_its_library(self):
        (self.folder / "floors.toml").write_text(
            'scenario = "paper_ball"\n[set]\nduration = 0.2\n"run.actuation" = "prescribed"\n'
            '[vary]\n"surface.static_friction" = { grid = [0.3, 0.4] }\n')
        self.run_in_folder("ballast", "sweep", "floors.toml", "--out", "floors")
        self.assertTrue((self.folder / "floors/sweep.nc").exists())

    def test_the_examples_in_python_run_with_the_installed_package(self):
        package = self.prefix / "lib/python3/dist-packages"
        scripts = sorted((self.prefix / "share/doc/ballast/python").glob("*.py"))
        self.assertEqual([script.name for script in scripts],
                         sorted(path.name for path in (ROOT / "tools/python/examples").glob("*.py")))
        for script in scripts:
            with self.subTest(script.name):
                self.run_in_folder("/usr/bin/python3", "-B", script, PYTHONPATH=str(package), MPLBACKEND="agg")
        self.assertTrue((self.folder / "friction.png").read_bytes().startswith(b"\x89PNG"))

    def test_an_installed_program_leaves_nothing_in_its_folder(self):
        before = sorted(self.prefix.rglob("*"))
        self.run_in_folder("ballast", "run", "paper_ball", "--set", "duration=0.1", "--pictures", "--quiet")
        self.assertEqual(sorted(self.prefix.rglob("*")), before)

    def test_python_runs_and_draws(self):
        script = ("import ballast\n"
                  "scenario = ballast.Scenario('paper_ball').set('duration', 1)\n"
                  "run = ballast.run(scenario, 'p')\n"
                  "print(run.end_reason, run.channels['contact'].normal_force_n.min() > 3)\n"
                  "run.plot().savefig('p.png')\n"
                  "print(ballast.integrate(scenario)['summary']['end']['reason'])\n"  # by the program `ballast`
                  "print(ballast.__file__)\n")
        python = {"PYTHONPATH": f"{self.prefix}/lib/python3/dist-packages"}
        said = self.run_in_folder("/usr/bin/python3", "-B", "-s", "-c", script, **python).splitlines()
        self.assertEqual(said[:2], ["completed True", "completed"])
        self.assertTrue(said[2].startswith(str(self.prefix)))
        self.run_in_folder("ballast", "run", "paper_ball", "--set", "duration=1", "--quiet", "--out", "a")
        self.assertEqual((self.folder / "a/run.lcmlog").read_bytes(), (self.folder / "p/run.lcmlog").read_bytes())


if __name__ == "__main__":
    unittest.main()
