"""tools/docs/summary.schema.json against the summaries of real runs of every kind: each is valid, and each field that the
schema names occurs in one of them."""
import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

import jsonschema

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCHEMA = json.loads((ROOT / "tools/docs/summary.schema.json").read_text())

# The runs, and the exit status that each has to have. Few seconds each.
RUNS = [
    (["run", "paper_ball", "--actuation", "prescribed"], 0),
    (["run", "paper_ball", "--check-steps"], 0),
    (["run", "paper_detach", "--set", "run.on_violation=continue"], 3),
    (["run", "paper_disk", "--set", "envelope.friction_use=0.01"], 3),
    (["run", "desk_ball", "--set", "duration=2"], 0),
    (["run", "hop"], 3),
    (["run", "slide_to_roll"], 0),
    (["run", "tumbleweed", "--set", "duration=2"], 0),
    (["run", "seam_ball", "--set", "duration=1"], 0),
    (["run", "paper_ball", "--set", "duration=1", "--fault", "sensor_nan@0.5:axis=1", "--fault", "push@0.2:0.001"], 3),
    (["run", "paper_ball", "--set", "duration=1", "--fault", "messages_dropped@0.5:peer=monitor"], 3),
    (["run", "desk_ball", "--set", "duration=2", "--fault", "blocked_rail@0.5:mass=1"], None),
    (["run", "paper_ball", "--set", "duration=1", "--fault", "messages_dropped@0.5:channel=BALLAST_TRIP"], 3),
    (["run", "paper_ball", "--actuation", "ideal", "--set", "run.hold=0.1", "--set", "duration=1"], 0),
    (["run", "paper_ball", "--set", "duration=1", "--set", "believed.ball.mass=1.2"], 0),
    (["run", "desk_ball", "--set", "sensors.preset=bmi088_calibrated", "--set", "run.hold=0.5", "--set", "duration=1"], 0),
    (["run", "paper_ball", "--set", "control.governor=true", "--set", "duration=1"], 0),
    (["run", "desk_ball", "--set", "sensors.preset=bmi088_calibrated", "--set", "duration=4", "--fault",
      "sensor_bias@3:0.3,sensor=gyro,axis=1"], 3),
    (["run", "END_STOP"], 3),
    (["run", "desk_ball", "--set", "plan.goal=[0.8,0.1]", "--set", "duration=1"], 0),
    (["move", "paper_ball", "--mass", "1", "--to", "2.5"], 0),
    (["integrate", "paper_ball"], 0),
]
# tests/sil/into_its_stop.h: a motor that loses steps on the way out drives its mass into the stop on the way back.
END_STOP = re.search(r'R"\((.*)\)"', (ROOT / "tests/sil/into_its_stop.h").read_text(), re.S)[1]
# Fields of the schema that need a broken program or a rare robot: an overload of the step generator, a violation of the
# step check, a mass outside the ball, a run that ends as inconsistent.
RARE = {"trip.error", "trip.steps_of_tick", "motors.[].end_stop.outside_ball.depth",
        "motors.[].end_stop.outside_ball.first_time", "step_timing.violations.[].kind"} | {
            f"step_timing.violations.[].{field}" for field in ("motor", "tick", "timer_ticks", "value", "limit", "text")}


def resolved(schema):
    return SCHEMA["$defs"][schema["$ref"].rsplit("/", 1)[1]] if "$ref" in schema else schema


def named(schema, path=""):
    """The path of every field of the schema."""
    schema = resolved(schema)
    for name, part in schema.get("properties", {}).items():
        yield f"{path}{name}"
        yield from named(part, f"{path}{name}.")
    if "items" in schema:
        yield from named(schema["items"], f"{path}[].")


def present(value, path=""):
    """The path of every field of a summary."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield f"{path}{name}"
            yield from present(part, f"{path}{name}.")
    elif isinstance(value, list):
        for part in value:
            yield from present(part, f"{path}[].")


class Schema(unittest.TestCase):
    def test_summaries_are_valid_and_show_every_field(self):
        jsonschema.Draft202012Validator.check_schema(SCHEMA)
        validator = jsonschema.Draft202012Validator(SCHEMA)
        occurred = set()
        with tempfile.TemporaryDirectory() as folder:
            end_stop = pathlib.Path(folder) / "end_stop.toml"
            end_stop.write_text(END_STOP)
            for arguments, status in RUNS:
                arguments = [str(end_stop) if word == "END_STOP" else word for word in arguments]
                with self.subTest(" ".join(arguments)):
                    done = subprocess.run([os.environ["BALLAST"], *arguments, "--quiet", "--out", f"{folder}/run"],
                                          capture_output=True, text=True)
                    if status is not None:
                        self.assertEqual(done.returncode, status, done.stderr)
                    summary = json.loads((pathlib.Path(folder) / "run/summary.json").read_text())
                    errors = [f"{error.json_path}: {error.message}" for error in validator.iter_errors(summary)]
                    self.assertEqual(errors, [])
                    occurred.update(present(summary))
        self.assertEqual(set(named(SCHEMA)) - occurred - RARE, set())

    def test_an_unknown_field_is_refused(self):
        validator = jsonschema.Draft202012Validator(SCHEMA)
        self.assertTrue(any("surprise" in error.message for error in validator.iter_errors({"surprise": 1})))


if __name__ == "__main__":
    unittest.main()
