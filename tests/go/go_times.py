"""How long `ballast operate go` takes, by the wall clock: random places on desk_ball, from rest and while the ball rolls.

    BALLAST=build/bin/ballast python3 tests/go/go_times.py FIRST LAST

Each seed is a run by hand with ten places up to 1.5 m from the middle, every other one while the ball rolls to the one
before. It prints a row per place and the medians. This is a study for an idle machine, not a test: no bound is checked.
"""

import argparse
import math
import os
import random
import re
import signal
import statistics
import subprocess
import tempfile
import time

PLACES = 10
ROLLS_S = 4  # until the next place, where the ball is to roll
TOLD = re.compile(r"planned in ([\d.]+) s, handed over in ([\d.]+) s")


def operate(bus, *arguments):
    done = subprocess.run([os.environ["BALLAST"], "operate", *arguments, "--lcm", bus], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def study(seed, times):
    """A run of ten places. Adds (planned, handed over) in s to the lists `times`["rest"] and ["rolling"]."""
    draw = random.Random(seed)
    bus = f"udpm://239.255.76.67:{20000 + os.getpid() % 40000}?ttl=0"
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.Popen([os.environ["BALLAST"], "run", "desk_ball", "--by-hand", "--lcm", bus, "--set", "control.governor=true",
                                "--set", "duration=600", "--quiet", "--no-log", "--out", folder])
        try:
            while operate(bus, "status")[0] != 0:
                time.sleep(0.1)
            for k in range(PLACES):
                angle, far_m = draw.uniform(0, 2 * math.pi), draw.uniform(0.2, 1.5)
                place = f"{far_m * math.cos(angle):.3f},{far_m * math.sin(angle):.3f}"
                rolling = k % 2 == 1
                waits = [] if k % 2 == 0 else ["--wait"]
                began = time.monotonic()
                _, said = operate(bus, "go", "--to", place, *waits)
                whole_s = time.monotonic() - began
                told = TOLD.search(said)
                kind = "rolling" if rolling else "rest"
                if told:
                    times[kind].append((float(told[1]), float(told[2])))
                print(f"{seed:4} {place:>14} {kind:8}", f"{told[1]} s {told[2]} s" if told else f"{whole_s:.2f} s",
                      said.strip().replace("\n", " | ") if not told or "is at" not in said and rolling else "", flush=True)
                if not rolling:
                    time.sleep(ROLLS_S)
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()


def main():
    parser = argparse.ArgumentParser(prog="go_times.py", description=__doc__.split("\n", 1)[0])
    parser.add_argument("first", type=int, help="seed")
    parser.add_argument("last", type=int, help="seed")
    options = parser.parse_args()
    times = {"rest": [], "rolling": []}
    for seed in range(options.first, options.last + 1):
        study(seed, times)
    for kind, pairs in [*times.items(), ("all", times["rest"] + times["rolling"])]:
        sums = sorted(planned + handed for planned, handed in pairs)
        print(f"{kind}: {len(pairs)} gone; planned in {statistics.median(p for p, _ in pairs):.2f} s, handed over in "
              f"{statistics.median(h for _, h in pairs):.2f} s (medians); together {statistics.median(sums):.2f} s (median), "
              f"{sums[int(0.95 * (len(sums) - 1))]:.2f} s (95 %)")


if __name__ == "__main__":
    main()
