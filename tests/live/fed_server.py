"""ballast-live, the server of the live page, fed by a test instead of a run: events in, requests out."""

import itertools
import json
import os
import re
import subprocess
import threading
from pathlib import Path

from synthetic_run import event

PATIENCE_S = 60
SUBPROTOCOL = "ballast.live.v1"
RADIUS_M = 0.15
ROBOT = {"gravity": 9.81, "ball": {"radius": RADIUS_M, "mass": 0.8, "center_of_mass": [0, 0, 0]},
         "masses": [{"mass": 0.28, "rail": {"shape": "line", "closed": False, "points": [[-0.1, 0, 0], [0.1, 0, 0]]}}]}
SCENARIO = 'name = "made_up"\n[surface]\nstatic_friction = 0.5\n'
COLUMNS = ["time", "normal_force", "static_friction", "mu_required", "margin", "regime", "floor_friction", "friction_force_0",
           "friction_force_1", "position_0", "position_1", "position_2", "orientation_0", "orientation_1", "orientation_2",
           "orientation_3", "center_of_mass_0", "center_of_mass_1", "center_of_mass_2", "speed", "mass_position_0", "mass_B_0",
           "mass_B_1", "mass_B_2", "commanded_0", "backup_margin", "estimated_position_0", "estimated_position_1",
           "position_sigma", "tilt_sigma", "yaw_sigma", "measured_mu_required", "measured_mu_sigma", "measured_normal_force",
           "measured_normal_sigma"]


def frame(time_s, x=0.0, y=0.0):
    """A frame as the feed sends it."""
    row = dict.fromkeys(COLUMNS)
    row.update({"time": time_s, "normal_force": 10.6, "static_friction": 1.0, "mu_required": 0.1, "margin": 0.8, "regime": 0,
                "floor_friction": 0.5, "position_0": x, "position_1": y, "position_2": 0, "orientation_0": 1})
    return [row[name] for name in COLUMNS]


class FedServer:
    """`port`, `token`, `address` of the page. Use as a context."""

    def __init__(self, *arguments):
        self._arguments = ["--port", "0", *arguments]
        self._numbers = itertools.count()
        self.requests, self._more = [], threading.Condition()

    def __enter__(self):
        program = Path(os.environ["BALLAST"]).parent / "ballast-live"
        self.process = subprocess.Popen([program, *self._arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)
        line = self.process.stderr.readline().decode()
        found = re.match(r"ballast: open (http://[^/]+:(\d+)/([\w-]+)/)$", line)
        if not found:
            self.process.stdin.close()
            said = line + self.process.stderr.read().decode()
            self.__exit__()
            raise AssertionError(said)
        self.address, self.port, self.token = found[1], int(found[2]), found[3]
        self.foxglove = self.process.stderr.readline().decode().split()[-1]
        threading.Thread(target=self._read, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.end()
        self.process.stdout.close()
        self.process.stderr.close()

    def end(self):
        """Ends the input. The exit status."""
        if not self.process.stdin.closed:
            self.process.stdin.close()
        return self.process.wait(PATIENCE_S)

    def _read(self):
        for line in self.process.stdout:
            with self._more:
                self.requests.append(json.loads(line))
                self._more.notify_all()

    def wait_for_requests(self, count):
        with self._more:
            assert self._more.wait_for(lambda: len(self.requests) >= count, PATIENCE_S), self.requests
            return self.requests[:count]

    def send(self, channel, content):
        data = content if isinstance(content, bytes) else (content if isinstance(content, str) else json.dumps(content)).encode()
        self.process.stdin.write(event(next(self._numbers), 0, channel, data))

    def flush(self):
        self.process.stdin.flush()

    def begin_run(self, name="made_up", robot=None):
        self.send("robot.json", robot or ROBOT)
        self.send("scenario.toml", SCENARIO)
        self.send("live.run", {"run": "1", "name": name, "duration": 10, "actuation": "stepper", "columns": COLUMNS,
                               "masses": [{"unit": "m", "lower_end": -0.1, "upper_end": 0.1}], "friction_changes": False,
                               "envelope": {"friction_use": 1, "min_normal_force": 0}})
        self.send("live.state", {"phase": "running", "mode": "armed", "trip": "", "faults": "", "trouble": ""})
        self.flush()

    def frames(self, rows):
        for row in rows:
            self.send("live.frame", row)
        self.flush()

    def resident_mb(self):
        """Memory of the server, which runs under a shell script that replaces itself."""
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8")
        return int(re.search(r"VmRSS:\s+(\d+) kB", status)[1]) / 1024
