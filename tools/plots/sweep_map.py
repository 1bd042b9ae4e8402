"""ballast-sweep-map MAP.json PICTURE: Draws the map that `ballast sweep --map` counted, as PNG, SVG or PDF."""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from command import run_program
from output_files import PICTURE_BEGINNINGS, Kind, OutputError, OutputFiles, check_place
from page import BLUE, VERMILLION, head

_SHARES = LinearSegmentedColormap.from_list("shares", [VERMILLION, "#F2F2F2", BLUE])
_MOST_LABELS = 16  # values of a grid that are all labelled


class MapError(Exception):
    """The file is no map."""


class Map:
    """The map's file. `name` is the scenario's, as head() wants it; `values` those of grids, by axis."""

    def __init__(self, path):
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            self.name, self.rows = found["scenario"], int(found["rows"])
            self.x, self.y = found["x"], found["y"]
            self.runs, held = np.array(found["runs"], dtype=float), np.array(found["held"], dtype=float)
            self.values = {key: list(map(float, side["values"])) for key, side in (("x", self.x), ("y", self.y))}
            shape = (len(self.y["edges"]) - 1, len(self.x["edges"]) - 1)
        except (ValueError, KeyError, TypeError) as error:
            raise MapError(f"{path}: not what ballast sweep --map writes ({error!r})") from error
        if self.runs.shape != shape or held.shape != shape or not self.runs.any():
            raise MapError(f"{path}: its counts do not fill its cells")
        with np.errstate(invalid="ignore"):
            self.share = held / self.runs  # NaN where a cell has no run


def _set_ticks(axis, logarithmic, values):
    """Labels the values of a grid, where each has a cell of its own, and 1, 2 and 5 of each decade of a logarithm."""
    if logarithmic:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        axis.set_minor_formatter(NullFormatter())
    elif 0 < len(values) <= _MOST_LABELS:
        axis.set_major_locator(FixedLocator(sorted(values)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))


def draw(found):
    figure = Figure(figsize=(8.4, 6.2), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
    axes = figure.subplots()
    axes.grid(False)
    axes.set_facecolor("#FFFFFF")
    mesh = axes.pcolormesh(found.x["edges"], found.y["edges"], np.ma.masked_invalid(found.share), cmap=_SHARES, vmin=0,
                           vmax=1, linewidth=0, rasterized=True)
    axes.set_xscale("log" if found.x["logarithmic"] else "linear")
    axes.set_yscale("log" if found.y["logarithmic"] else "linear")
    _set_ticks(axes.xaxis, found.x["logarithmic"], found.values["x"])
    _set_ticks(axes.yaxis, found.y["logarithmic"], found.values["y"])
    axes.set_xlabel(found.x["key"])
    axes.set_ylabel(found.y["key"])
    bar = figure.colorbar(mesh, ax=axes, pad=0.02)
    bar.set_label("share of the runs that hold")
    bar.outline.set_visible(False)
    empty = [Patch(facecolor="#FFFFFF", edgecolor="#7F7F7F", label="no run")] if np.isnan(found.share).any() else []
    beyond = found.rows - int(found.runs.sum())  # values of a normal distribution beyond 3 deviations
    head(axes, found, f"Which of {found.rows} runs hold" + (f" ({beyond} lie outside)" if beyond else ""), [empty])
    return figure


def main():
    parser = argparse.ArgumentParser(prog="ballast-sweep-map",
                                     description="Draws the map that `ballast sweep --map` counted.")
    parser.add_argument("map", type=Path, help="the .json file of `ballast sweep --map`")
    parser.add_argument("picture", type=Path, help="file that ends in .png, .svg or .pdf")
    arguments = parser.parse_args()

    def body():
        kind_name = arguments.picture.suffix[1:]
        if kind_name not in PICTURE_BEGINNINGS:
            raise OutputError(f"{arguments.picture}: allowed: a name that ends in .png, .svg or .pdf")
        kind = Kind(f"{kind_name.upper()} picture", PICTURE_BEGINNINGS[kind_name])
        check_place(arguments.picture, kind)
        figure = draw(Map(arguments.map))
        with OutputFiles(arguments.picture) as files:
            figure.savefig(files.open(arguments.picture, kind), dpi=110, format=kind_name)

    return run_program("ballast-sweep-map", body, MapError, OutputError)


if __name__ == "__main__":
    sys.exit(main())
