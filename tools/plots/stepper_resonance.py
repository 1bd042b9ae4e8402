#!/usr/bin/python3
"""stepper_resonance.py CSV PNG: Draws the swing of a motor's rotor while its speed sweeps through the resonance.

physics_test's Resonance.MicrosteppingCalmsIt writes CSV to BALLAST_RESONANCE_OUT, one line per speed: microsteps,
natural frequency in Hz, full steps per second, swing of the rotor about the even motion in full steps (half of peak to
peak).
"""

import sys

import numpy as np
import page

NAMES = {1: "full steps", 2: "half steps", 16: "1/16 steps"}


def draw(rows, png_path):
    figure, (axes,) = page.blank_page((10, 5.5))
    natural_hz = rows[0, 1]
    lines = []
    for microsteps, color in zip(NAMES, page.MASS_COLORS):
        selected = rows[rows[:, 0] == microsteps]
        lines.append(axes.plot(selected[:, 2], selected[:, 3], color=color, linewidth=2, label=NAMES[microsteps])[0])
    top = 1.05 * rows[:, 3].max()
    for part, text in ((1, "f"), (2, "f/2"), (3, "f/3"), (4, "f/4")):
        axes.axvline(natural_hz / part, color=page.GREY, linewidth=1, linestyle=":")
        axes.annotate(text, (natural_hz / part, top), textcoords="offset points", xytext=(4, -12), color=page.GREY)
    axes.set_xlim(rows[:, 2].min(), rows[:, 2].max())
    axes.set_ylim(0, top)
    axes.set_xlabel("speed, full steps/s")
    axes.set_ylabel("swing about the even motion, full steps")
    above = page.legend_above(axes, [lines])
    axes.set_title(f"A NEMA 17 swept through its natural frequency, f = {natural_hz:.0f} Hz", loc="left", pad=10 + above)
    figure.savefig(png_path, dpi=120)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    draw(np.loadtxt(sys.argv[1], delimiter=","), sys.argv[2])


if __name__ == "__main__":
    main()
