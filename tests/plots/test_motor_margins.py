"""The motors' margins as the pictures find them from the log, against what the plant itself noted in summary.json."""

import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

from recorded_run import RecordedRun


class MotorMarginsTest(unittest.TestCase):
    def motors(self, scenario, actuation, *sets):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "run"
            line = [os.environ["BALLAST"], "run", scenario, "--actuation", actuation, "--out", out, "--quiet"]
            for value in ("duration=2", *sets):
                line += ["--set", value]
            run = subprocess.run(line, capture_output=True, text=True, check=False)
            self.assertIn(run.returncode, (0, 3), run.stderr)  # 3: shaken masses may make the ball slip
            return RecordedRun(out).motors()

    def compare(self, motors, tolerance):
        self.assertTrue(motors)
        for i, motor in enumerate(motors):
            with self.subTest(motor=i):
                self.assertLessEqual(np.abs(motor.torque_nm).max(), motor.greatest_nm)
                self.assertGreaterEqual(motor.margin.min(), motor.least_margin - 1e-12)  # rounding
                self.assertLessEqual(motor.margin.min(), motor.least_margin + tolerance)

    def test_prescribed(self):
        # Smooth between its corners, which fall on ticks: at its least a margin changes by far less than this in 1 ms.
        self.compare(self.motors("desk_ball", "prescribed"), 1e-4)

    def test_prescribed_above_the_corner_speed(self):
        motors = self.motors("desk_ball", "prescribed", "mass.0.motor.corner_speed=1.0")
        self.assertLess(motors[0].available_nm.min(), 0.3)  # of 0.35; the shaft reaches 3.6 rad/s
        self.compare(motors, 1e-4)

    def test_prescribed_on_too_low_a_supply(self):
        motors = self.motors("desk_ball", "prescribed", "mass.0.motor.supply_voltage=6.5")
        self.assertLess(motors[0].available_nm.min(), 0.3)
        self.compare(motors, 1e-4)

    def test_steppers_with_and_without_detent(self):
        # A microstep moves the field by 90/16 degrees of lag, up to three of them somewhere in a tick: samples where
        # ticks begin miss the deepest margin by some hundredths. A detent of 0.15 N m of 0.35 weighs up to 0.43.
        for detent in ("0.0", "0.15"):
            sets = [f"mass.{i}.motor.detent_torque={detent}" for i in range(3)]
            self.compare(self.motors("desk_ball", "stepper", *sets), 0.05)


if __name__ == "__main__":
    unittest.main()
