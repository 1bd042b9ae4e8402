"""ballast-report LOG: Makes one HTML page of a finished run, for `ballast report`."""

import argparse
import sys
from pathlib import Path

from assemble import page_begins, report_page
from command import run_program
from event_log import LogError
from output_files import Kind, OutputError, OutputFiles, check_place
from packages import PackageError
from recording import Recording

ERRORS = (LogError, PackageError, OutputError)
_PAGE = Kind("page of ballast report", page_begins("report"))


def write_page(path, text, kind, inputs):
    with OutputFiles(path, inputs) as files:
        files.open(path, kind, encoding="utf-8").write(text)
    print(f"{path}  ({len(text.encode()) / 1e6:.1f} MB)")


def main():
    parser = argparse.ArgumentParser(prog="ballast-report", description="Makes one HTML page of a finished run.")
    parser.add_argument("log", type=Path, help="run.lcmlog, or the folder of the run")
    parser.add_argument("--out", type=Path, help="default: report.html beside the log")
    arguments = parser.parse_args()

    def body():
        recording = Recording(arguments.log)
        out = arguments.out or recording.folder / "report.html"
        check_place(out, _PAGE, recording.files)  # before the work is done
        write_page(out, report_page(recording), _PAGE, recording.files)
        for fault in recording.faults:  # the page shows them too
            print(f"ballast-report: {fault}", file=sys.stderr)

    return run_program("ballast-report", body, *ERRORS)


if __name__ == "__main__":
    sys.exit(main())
