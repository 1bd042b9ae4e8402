"""start.py SCRIPT [ARGUMENT]...: Runs a script; Ctrl-C ends it without a traceback while its libraries load."""

import runpy
import signal
import sys

if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # command.run_program() takes over
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
