"""The promises of tools/docs/stability.md, held to the recordings of earlier versions in recorded/."""
import csv
import importlib.machinery
import importlib.util
import json
import unittest
from pathlib import Path

from installation import BUILD, ROOT, VERSION, Installed

HERE = Path(__file__).resolve().parent
BALLAST = BUILD / "bin/ballast"
CHANNELS = {"BALLAST_CONTACT", "BALLAST_PLANT_STATE", "BALLAST_SENSORS", "BALLAST_STEP_COMMAND", "BALLAST_CONTROLLER_STATUS",
            "BALLAST_TRIP", "BALLAST_OPERATOR"}


def load_script(path):
    loader = importlib.machinery.SourceFileLoader("record", str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("record", loader))
    loader.exec_module(module)
    return module


record = load_script(HERE / "record")


def lost(old, new, path=""):
    """The keys of `old` that `new` lacks or has with another type. null stands for any type."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key, value in old.items():
            if key not in new:
                yield f"{path}{key}: is missing"
            else:
                yield from lost(value, new[key], f"{path}{key}.")
    elif isinstance(old, list) and isinstance(new, list):
        if old and new:
            yield from lost(old[0], new[0], f"{path}0.")
    elif old is not None and new is not None:
        both_numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in (old, new))
        if not both_numbers and type(old) is not type(new):
            yield f"{path[:-1]}: was {old!r}, is {new!r}"


class Recorded(Installed):
    components = ()

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        major = VERSION.split(".")[0]
        cls.versions = sorted(path for path in (HERE / "recorded").iterdir() if path.name.split(".")[0] == major)

    def each_version(self):
        """The folder and the promises of each."""
        self.assertTrue(self.versions)
        return [(version, json.loads((version / "promises.json").read_text())) for version in self.versions]

    def test_logs_are_read(self):
        for version, _ in self.each_version():
            tables = self.folder / version.name
            said = self.run_in_folder(BALLAST, "export", version, "--csv", tables)
            self.assertIn(f"{len(CHANNELS)} channels", said)
            self.assertEqual({path.stem for path in tables.iterdir()}, CHANNELS)
            with open(tables / "BALLAST_CONTACT.csv", newline="", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            self.assertEqual([int(row["tick"]) for row in rows], list(range(-2, 21)))
            for row in rows:
                self.assertEqual(float(row["time_s"]), max(0, int(row["tick"])) * 0.001)
                # Forces and what follows from them: the fields are where they were.
                self.assertAlmostEqual(float(row["mu_required"]), float(row["static_friction_n"]) / float(row["normal_force_n"]),
                                       delta=1e-15)  # a rounding of a number below 1
            with open(tables / "BALLAST_STEP_COMMAND.csv", newline="", encoding="utf-8") as file:
                self.assertGreater(sum(int(row["burst_count"]) for row in csv.DictReader(file)), 0)
            self.run_in_folder(BALLAST, "replay", version)  # the firmware gets the recorded inputs

    def test_scenarios_are_accepted(self):
        known = set(record.scenario_keys(ROOT))
        for version, promises in self.each_version():
            self.assertGreater(len(promises["scenario_keys"]), 50)
            self.assertEqual(set(promises["scenario_keys"]) - known, set())
            self.run_in_folder(BALLAST, "check", version / "scenario.toml")

    def test_summaries_keep_their_keys(self):
        for version, _ in self.each_version():
            out = self.folder / version.name
            self.run_in_folder(BALLAST, "run", version / "scenario.toml", "--quiet", "--out", out)
            for name in ("summary.json", "robot.json"):
                old, new = (json.loads((folder / name).read_text()) for folder in (version, out))
                self.assertEqual(list(lost(old, new)), [])

    def test_commands_keep_their_options(self):
        today = record.command_line(BALLAST)
        for _, promises in self.each_version():
            for command, options in promises["command_line"].items():
                self.assertEqual(set(options) - set(today.get(command, [])), set(), command)

    def test_python_keeps_its_names(self):
        today = set(record.python_names(BUILD / "python"))
        for _, promises in self.each_version():
            self.assertEqual(set(promises["python"]) - today, set())

    def test_a_broken_promise_is_found(self):
        self.assertEqual(list(lost({"a": {"b": 1.0}, "c": [{"d": "x"}]}, {"a": {"b": 1}, "c": [{"d": "y", "e": 0}], "f": 1})), [])
        self.assertEqual(len(list(lost({"a": {"b": 1.0}, "c": 2}, {"a": {"b": "1"}}))), 2)

    def test_no_recording_is_newer_than_this_version(self):
        number = [int(part) for part in VERSION.split(".")]
        self.assertLessEqual(max([int(part) for part in path.name.split(".")] for path in self.versions), number)
        self.assertIn(f"## {VERSION}\n", (ROOT / "tools/docs/changelog.md").read_text())


if __name__ == "__main__":
    unittest.main()
