"""ballast-chart CHART.json PICTURE: Draws what `ballast plan --chart` found, as PNG, SVG or PDF."""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from command import run_program
from output_files import PICTURE_BEGINNINGS, Kind, OutputError, OutputFiles, check_place
from page import BLUE, GREY, VERMILLION, head, legend_above
from short_number import short_number


class ChartError(Exception):
    """The file is no chart."""


class Chart:
    """The chart's file. `name` is the scenario's, as head() wants it."""

    def __init__(self, path):
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            self.name, self.distance, self.at_rest = found["scenario"], float(found["distance"]), found["at_rest"]
            self.use, self.floor, self.given = found["friction_use"], found["static_friction"], found["task_duration"]
            planned = [point for point in found["points"] if point["mu_required"] is not None]
            failed = [point["duration"] for point in found["points"] if point["mu_required"] is None]
            self.duration = np.array([point["duration"] for point in planned])
            self.need = np.array([point["mu_required"] for point in planned])
            self.stepper = np.array([point["stepper_mu_required"] or np.nan
                                     if point["stepper_end"] == "completed" else np.nan for point in planned])
            self.no_plan_s = max(failed, default=None)
            self.shortest = found["shortest_time"]
        except (ValueError, KeyError, TypeError) as error:
            raise ChartError(f"{path}: not what ballast plan --chart writes ({error!r})") from error
        if len(self.duration) == 0:
            raise ChartError(f"{path}: has no duration with a plan")


def _plain(axis):
    """A logarithmic axis with its numbers written out."""
    low, high = axis.get_view_interval()
    narrow = high < 10 * low
    axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 3.0, 4.0, 6.0, 8.0) if narrow else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())


def _friction_over_time(axes, chart):
    curve = axes.plot(chart.duration, chart.need, color=BLUE, marker="o", markersize=4, label="the plan")
    rows = [curve]
    if np.isfinite(chart.stepper).any():
        rows[0] = curve + axes.plot(chart.duration, chart.stepper, linestyle="", marker="o", markersize=6,
                                    markerfacecolor="white", color=VERMILLION, markeredgewidth=1.7,
                                    label="with its steppers")
    low, high = np.nanmin([chart.need.min(), np.nanmin(chart.need)]), np.nanmax([chart.need, chart.stepper])
    limits = []
    if chart.floor is not None:
        limits.append(axes.axhline(chart.floor, color=VERMILLION, linestyle="--", linewidth=1.2,
                                   label=rf"$\mu_\mathrm{{s}}$ = {short_number(chart.floor)}"))
        limits.append(axes.axhline(chart.use * chart.floor, color=BLUE, linestyle="--", linewidth=1.2,
                                   label=rf"{short_number(chart.use)} $\mu_\mathrm{{s}}$, which plans may use"))
        high = max(high, chart.floor)
    axes.set_xscale("log")
    axes.set_yscale("log")
    left = chart.duration[0]
    if chart.no_plan_s is not None:
        left = chart.no_plan_s
        axes.axvspan(0.8 * left, left, color="#EEEEEE", linewidth=0, zorder=0)
        limits.append(Line2D([], [], color="#DDDDDD", linewidth=8, label="no plan found"))
        left *= 0.92
    axes.set_xlim(0.97 * left, 1.05 * chart.duration[-1])
    axes.set_ylim(0.8 * low, 1.3 * high)
    _plain(axes.xaxis)
    _plain(axes.yaxis)
    axes.set_xlabel("time allowed [s]")
    axes.set_ylabel(r"greatest $f_\mathrm{s}/N$")
    return [*rows, limits]


def _time_over_friction(axes, chart):
    rows = [row for row in chart.shortest if row["duration"] is not None]
    floors = [row["mu_s"] for row in rows]
    handles = axes.plot(floors, [row["duration"] for row in rows], color=BLUE, marker="o", markersize=4,
                        label="the plan")
    with_steppers = [row for row in chart.shortest if row["stepper_duration"] is not None]
    if with_steppers:
        handles += axes.plot([row["mu_s"] for row in with_steppers], [row["stepper_duration"] for row in with_steppers],
                             color=VERMILLION, linestyle=":", marker="o", markersize=6, markerfacecolor="white",
                             markeredgewidth=1.7, label="with its steppers")
    if chart.floor is not None:
        handles.append(axes.axvline(chart.floor, color=GREY, linestyle="--", linewidth=1.2,
                                    label=rf"this floor, $\mu_\mathrm{{s}}$ = {short_number(chart.floor)}"))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(0.9 * chart.duration[0], 1.1 * chart.duration[-1])
    _plain(axes.xaxis)
    _plain(axes.yaxis)
    axes.set_xlabel(r"$\mu_\mathrm{s}$ of the floor")
    axes.set_ylabel("shortest time [s]")
    return [handles]


def draw(chart):
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.14, h_pad=0.12)
    left, right = figure.subplots(1, 2)
    how = "to rest" if chart.at_rest else "passing there"
    rows = _friction_over_time(left, chart)
    head(left, chart, f"{short_number(chart.distance)} m {how}: least friction over time", rows, name_axes=right)
    height = legend_above(right, [*_time_over_friction(right, chart), []])
    line = height  # one row: the right panel's title stands as high as the left one's
    right.set_title("Shortest time over the floor", loc="left", pad=10 + len(rows) * line)
    return figure


def main():
    parser = argparse.ArgumentParser(prog="ballast-chart",
                                     description="Draws what `ballast plan --chart` found.")
    parser.add_argument("chart", type=Path, help="the .json file of `ballast plan --chart`")
    parser.add_argument("picture", type=Path, help="file that ends in .png, .svg or .pdf")
    arguments = parser.parse_args()

    def body():
        kind_name = arguments.picture.suffix[1:]
        if kind_name not in PICTURE_BEGINNINGS:
            raise OutputError(f"{arguments.picture}: allowed: a name that ends in .png, .svg or .pdf")
        kind = Kind(f"{kind_name.upper()} picture", PICTURE_BEGINNINGS[kind_name])
        check_place(arguments.picture, kind)
        figure = draw(Chart(arguments.chart))
        with OutputFiles(arguments.picture) as files:
            figure.savefig(files.open(arguments.picture, kind), dpi=150, format=kind_name)

    return run_program("ballast-chart", body, ChartError, OutputError)


if __name__ == "__main__":
    sys.exit(main())
