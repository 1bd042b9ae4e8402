"""ballast-plot RUN_DIR: Draws the pictures of a finished run into its folder."""

import argparse
import sys
from pathlib import Path

from command import run_program, show_progress
from event_log import LogError
from output_files import PICTURE_BEGINNINGS, Kind, OutputError, OutputFiles, check_place
from pictures import PICTURES
from recorded_run import RecordedRun


def main():
    parser = argparse.ArgumentParser(prog="ballast-plot",
                                     description="Draws the pictures of a finished run into its folder.")
    parser.add_argument("run_dir", type=Path, help="folder with run.lcmlog and summary.json")
    parser.add_argument("--format", choices=tuple(PICTURE_BEGINNINGS), default="png", help="default: png")
    arguments = parser.parse_args()
    kind = Kind(f"{arguments.format.upper()} picture", PICTURE_BEGINNINGS[arguments.format])

    def body():
        run = RecordedRun(arguments.run_dir)
        if run.damage:
            log = arguments.run_dir / "run.lcmlog"
            print(f"ballast-plot: {log}: {run.damage}; drew what comes before", file=sys.stderr)
        for number, (name, draw) in enumerate(PICTURES.items()):
            show_progress(f"picture {number + 1} of {len(PICTURES)}: {name}")
            figure = draw(run)
            path = arguments.run_dir / f"{name}.{arguments.format}"
            check_place(path, kind)
            if figure is None:
                path.unlink(missing_ok=True)  # a picture of an earlier run in this folder
                continue
            with OutputFiles(path) as files:
                figure.savefig(files.open(path, kind), dpi=150, format=arguments.format)
        show_progress("")

    return run_program("ballast-plot", body, LogError, OutputError)


if __name__ == "__main__":
    sys.exit(main())
