"""ballast-plot RUN_DIR: draws a finished run's log as pictures into RUN_DIR."""

import argparse
import sys
from pathlib import Path

from event_log import LogError
from pictures import PICTURES
from recorded_run import RecordedRun


def main():
    parser = argparse.ArgumentParser(prog="ballast-plot",
                                     description="Draws the pictures of a finished run into its folder.")
    parser.add_argument("run_dir", type=Path, help="folder with run.lcmlog and summary.json")
    parser.add_argument("--format", choices=("png", "svg", "pdf"), default="png", help="default: png")
    arguments = parser.parse_args()
    try:
        run = RecordedRun(arguments.run_dir)
        if run.damage:
            log = arguments.run_dir / "run.lcmlog"
            print(f"ballast-plot: {log}: {run.damage}; drawing what comes before", file=sys.stderr)
        for name, draw in PICTURES.items():
            figure = draw(run)
            path = arguments.run_dir / f"{name}.{arguments.format}"
            if figure is not None:
                figure.savefig(path, dpi=150)
            else:
                path.unlink(missing_ok=True)  # of an earlier run in this folder
    except LogError as error:
        print(f"ballast-plot: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"ballast-plot: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
