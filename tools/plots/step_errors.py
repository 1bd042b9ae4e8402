#!/usr/bin/python3
"""step_errors.py CSV SUMMARY PNG: Draws how far step pulses are from their crossings, and prints it as a table.

stepcheck_test writes CSV to BALLAST_STEPCHECK_OUT, one line per kind of motion: name, steps, worst error in us, worst
error as a fraction of the tolerance, 20 bins from -1 to 1 tolerances. SUMMARY is the summary.json of a run with
--check-steps.
"""

import json
import sys

import numpy as np
import page


def read(csv_path, summary_path):
    rows = []
    with open(summary_path, encoding="utf-8") as file:
        summary = json.load(file)
    motors = summary["step_timing"]["motors"]
    bins = np.sum([motor["histogram"] for motor in motors], axis=0)
    worst = max(motor["max_error_us"] / motor["tolerance_us"] for motor in motors)
    rows.append((f"{summary['scenario']}, 10 MHz", summary["step_timing"]["checked_steps"], worst, bins))
    with open(csv_path, encoding="utf-8") as file:
        for line in file:
            fields = line.split(",")
            rows.append((fields[0], int(fields[1]), float(fields[3]), np.array([int(n) for n in fields[4:]])))
    return rows


def table(rows):
    """Prints the table. Bins of opposite sign and equal size are added up, as fractions of all steps."""
    limits = (0.1, 0.2, 0.5, 0.8, 1.0)
    print("| motion | steps | worst, of the tolerance | " + " | ".join(f"to {limit:g}" for limit in limits) + " |")
    print("|---|---|---|" + "---|" * len(limits))
    for name, steps, worst, bins in rows:
        folded = bins[10:] + bins[9::-1]
        parts = [folded[:round(10 * limit)].sum() / bins.sum() for limit in limits]
        print(f"| {name} | {steps:,} | {worst:.4f} | " + " | ".join(f"{100 * part:.2f} %" for part in parts) + " |")


def draw(rows, png_path):
    figure, (axes,) = page.blank_page((10, 5.5))
    edges = np.linspace(-1, 1, 21)
    lines = []
    for (name, _, _, bins), color in zip(rows, page.MASS_COLORS):
        part = bins / bins.sum()
        lines.append(axes.stairs(np.where(part > 0, part, np.nan), edges, baseline=None, color=color, linewidth=2,
                                 label=name))
    axes.set_yscale("log")
    axes.set_xlim(-1.02, 1.02)
    axes.set_xlabel("pulse minus crossing, in tolerances (1 timer tick or 0.5 us, whichever is larger)")
    axes.set_ylabel("part of all steps, per bin of 0.1")
    above = page.legend_above(axes, [lines[:3], lines[3:]])
    axes.set_title("Errors of the step times", loc="left", pad=10 + above)
    figure.savefig(png_path, dpi=120)


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    rows = read(sys.argv[1], sys.argv[2])
    table(rows)
    draw(rows, sys.argv[3])


if __name__ == "__main__":
    main()
