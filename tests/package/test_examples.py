"""The examples, built by a project of their own against an installation, and their numbers against physics."""
import json
import math
import re
import subprocess
import unittest

from installation import CMAKE, Installed


class Examples(Installed):
    components = ("programs", "development")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        examples, build = cls.prefix / "share/doc/ballast/examples", cls.scratch / "build"
        for command in ([CMAKE, "-S", examples, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={cls.prefix}",
                         "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror"],
                        ["ninja", "-C", build]):
            done = subprocess.run(command, env=cls.environment, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise AssertionError(done.stdout + done.stderr)
        cls.build = build

    def numbers(self, example, *arguments, status=0):
        said = self.run_in_folder(self.build / example, *arguments, status=status)
        return said, [float(number) for number in re.findall(r"(?<![\w/])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", said)]

    def assert_as_its_comment_says(self, example, said):
        source = (self.prefix / f"share/doc/ballast/examples/{example}.cpp").read_text()
        for line in said.splitlines():
            self.assertIn(f"//   {line}\n", source)

    def test_01_tick(self):
        said, numbers = self.numbers("01_tick")
        self.assert_as_its_comment_says("01_tick", said)
        weight_n = (0.8 + 0.4) * 9.81
        self.assertIn("tick 0: running", said)
        self.assertAlmostEqual(numbers[1], weight_n, delta=5e-4)  # printed with three decimals
        # Each half of the motion: speed up to 0.4 rad/s^2 * 0.5 s over 1 s, on average half of it.
        travel_rad = 2 * 0.5 * 0.4 * 0.5
        self.assertAlmostEqual(numbers[2], travel_rad, delta=1e-9)  # printed with nine digits
        self.assertEqual(numbers[3], round(travel_rad * 3200 / (2 * math.pi)))

    def test_02_plant(self):
        _, (time_s, energy_j, change_j, least_n) = self.numbers("02_plant")
        self.assertEqual(time_s, 10)
        self.assertAlmostEqual(energy_j, -0.4 * 9.81 * 0.1 * math.cos(0.5), delta=1e-9)  # at rest: the mass's height
        # The plant's default tolerance is 1e-10 of a step; a hundred steps a second add up for 10 s at worst.
        self.assertLess(change_j, 1e3 * 1e-10)
        self.assertTrue(0 < least_n < 1.2 * 9.81)

    def test_03_closed_loop(self):
        said, numbers = self.numbers("03_closed_loop")
        self.run_in_folder("ballast", "run", "paper_ball", "--quiet", "--out", "run")
        summary = json.loads((self.folder / "run/summary.json").read_text())
        self.assertTrue(said.startswith(summary["end"]["reason"]))
        self.assertEqual(numbers[:4], [summary["end"]["time"], summary["travel"]["distance"],
                                       summary["normal_force"]["min"], summary["mu_required"]["max"]])

    def test_04_own_board(self):
        said, numbers = self.numbers("04_own_board")
        self.assert_as_its_comment_says("04_own_board", said)
        pulses = round(0.2 * 3200 / (2 * math.pi))  # the motion of test_01_tick
        self.assertEqual(numbers, [2005, pulses, 0, pulses, 2005])

    def test_05_monitor(self):
        self.run_in_folder("ballast", "run", "paper_ball", "--quiet", "--out", "free")
        self.run_in_folder("ballast", "run", "paper_ball", "--quiet", "--out", "half", "--set", "envelope.friction_use=0.5",
                           status=3)
        trip = json.loads((self.folder / "half/summary.json").read_text())["trip"]
        said, numbers = self.numbers("05_monitor", "free/run.lcmlog", "0.35", status=3)
        self.assertIn("tripped at tick", said)
        # Until the trip both runs are the same, so this monitor trips where that of the run has.
        self.assertEqual(numbers[0], round(trip["time"] / 0.001))
        self.assertAlmostEqual(numbers[-1], 0.5 * 0.35, delta=1e-9)  # printed with nine digits
        self.assertGreater(numbers[-2], numbers[-1])


if __name__ == "__main__":
    unittest.main()
