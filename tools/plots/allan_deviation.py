#!/usr/bin/python3
"""allan_deviation.py CSV PNG: Draws the Allan deviations of the sensor model's IMUs beside the lines they should follow.

physics_test's Triad.ItsAllanDeviationLiesOnTheLinesOfNoiseAndWalk writes CSV to BALLAST_ALLAN_OUT, one line per
averaging time: part, gyro or accelerometer, tau in s, Allan deviation, noise density, bias walk.
"""

import csv
import sys

import numpy as np
import page

TITLES = {"gyro": ("Gyroscopes", "Allan deviation [rad/s]"), "accelerometer": ("Accelerometers", r"Allan deviation [m/s$^2$]")}


def read(csv_path):
    """{(part, kind): rows of tau, deviation, density, walk}"""
    found = {}
    with open(csv_path, newline="", encoding="utf-8") as file:
        for part, kind, *numbers in csv.reader(file):
            found.setdefault((part, kind), []).append([float(number) for number in numbers])
    return {key: np.array(rows) for key, rows in found.items()}


def draw(found, png_path):
    figure, all_axes = page.blank_page((10, 9), rows=2)
    for axes, (kind, (title, label)) in zip(all_axes, TITLES.items()):
        handles, shown = [], set()
        for (part, what), color in zip([key for key in found if key[1] == kind], page.MASS_COLORS):
            tau, deviation, density, walk = found[part, what].T
            line, = axes.loglog(tau, deviation, linestyle="", marker="o", markersize=5, color=color, label=part)
            axes.loglog(tau, density / np.sqrt(2 * tau), color=color, linewidth=1.2)
            handles.append(line)
            if walk[0] not in shown:
                axes.loglog(tau, walk * np.sqrt(tau / 3), color=page.GREY, linewidth=1.2, linestyle="--")
            shown.add(walk[0])
        axes.set_ylim(0.3 * min(found[key][:, 1].min() for key in found if key[1] == kind))
        handles.append(axes.plot([], [], color=page.BLACK, linewidth=1.2, label=r"noise alone: $n / \sqrt{2 \tau}$")[0])
        handles.append(axes.plot([], [], color=page.GREY, linewidth=1.2, linestyle="--", label=r"walk alone: $K \sqrt{\tau / 3}$")[0])
        axes.set_xlabel(r"averaging time $\tau$ [s]")
        axes.set_ylabel(label)
        above = page.legend_above(axes, [handles])
        axes.set_title(title + " at rest, $10^6$ samples at 100 Hz", loc="left", pad=10 + above)
    figure.savefig(png_path, dpi=110)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    draw(read(sys.argv[1]), sys.argv[2])


if __name__ == "__main__":
    main()
