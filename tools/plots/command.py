"""How the Python programs end: exit status, messages and signals."""

import os
import signal
import sys

COULD_NOT_RUN = 2  # the same in all programs of this project


def run_program(name, body, *errors):
    """Runs body() and returns the exit status. Exceptions of the types `errors` are printed to stderr after `name`."""
    # SIGTERM and SIGHUP act like Ctrl-C, so that half-written files are removed. nohup's ignored SIGHUP stays ignored.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _terminal_closed)
    try:
        body()
        sys.stdout.flush()
        return 0
    except errors as error:
        why = str(error)
    except OSError as error:
        why = f"{error.filename or 'standard output'}: {error.strerror}"
    except KeyboardInterrupt:
        why = "interrupted"
    show_progress("")
    print(f"{name}: {why}", file=sys.stderr)
    if not _can_flush():
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # otherwise Python complains again at exit
    return COULD_NOT_RUN


def show_progress(text):
    """Replaces the line on a terminal that tells how far the program is. Empty: removes it. Without a terminal: nothing."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def _terminal_closed(number, frame):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the terminal sends one, and its shell another
    signal.default_int_handler(number, frame)


def _can_flush():
    try:
        sys.stdout.flush()
    except OSError:
        return False
    return True
