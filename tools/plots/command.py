"""What the programs in Python have in common: how they end."""

import os
import signal
import sys

COULD_NOT_RUN = 2  # as of every program here


def run_program(name, body, *errors):
    """The exit status of what body() does. `errors` are of what it reads and writes: said on stderr, after `name`."""
    # As Ctrl-C does, so that what is half made is taken away. Under nohup a closed terminal is none of its business.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
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
    print(f"{name}: {why}", file=sys.stderr)
    if not _can_flush():
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python would complain of the rest once more
    return COULD_NOT_RUN


def _terminal_closed(number, frame):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the terminal says so, and its shell once more
    signal.default_int_handler(number, frame)


def _can_flush():
    try:
        sys.stdout.flush()
    except OSError:
        return False
    return True
