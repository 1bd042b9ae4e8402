"""The program `ballast` as a child process."""

from __future__ import annotations

import subprocess
from pathlib import Path

from . import _core
from ._errors import RunError

COMPLETED, OUTSIDE = 0, 3  # exit statuses: as it should be; outside the envelope, or no plan


def run_program(*arguments: str) -> tuple[int, str, str]:
    """(exit status, output, errors without the program's name) of `ballast` with these arguments.

    Ends the program where this thread is interrupted. Raises RunError if it cannot be started.
    """
    program = Path(_core.programs) / "ballast"
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen([program, *arguments], stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True)
    except OSError as error:
        raise RunError(f"{program}: cannot be started: {error.strerror}") from error
    with process:
        try:
            output, errors = process.communicate()
        except BaseException:
            process.terminate()
            process.wait()
            raise
    return process.returncode, output, errors.strip().removeprefix("ballast: ")
