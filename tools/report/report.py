"""ballast-report LOG: one HTML page of a finished run. `ballast report` calls it."""

import argparse
import os
import sys
import tempfile
from pathlib import Path

from assemble import report_page
from event_log import LogError
from packages import PackageError
from recording import Recording


def write_page(path, text):
    """Whole or not at all."""
    try:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=path.parent, delete=False) as part:
            try:
                part.write(text)
                part.flush()
                os.chmod(part.name, 0o644)
                os.replace(part.name, path)
            except BaseException:
                os.unlink(part.name)
                raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    print(f"{path}  ({len(text.encode()) / 1e6:.1f} MB)")


def run_program(name, body):
    """The program's exit status; what went wrong goes to stderr, after its name."""
    try:
        body()
    except (LogError, PackageError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{name}: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    return 0


def main():
    parser = argparse.ArgumentParser(prog="ballast-report", description="Makes one HTML page of a finished run.")
    parser.add_argument("log", type=Path, help="run.lcmlog, or the folder of the run")
    parser.add_argument("--out", type=Path, help="default: report.html beside the log")
    arguments = parser.parse_args()

    def body():
        recording = Recording(arguments.log)
        write_page(arguments.out or recording.folder / "report.html", report_page(recording))

    return run_program("ballast-report", body)


if __name__ == "__main__":
    sys.exit(main())
