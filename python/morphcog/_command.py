"""The command `morphcog`."""

import shlex
import signal
import sys

from ._morphcog import command


def main():
    # The program handles signals itself, or is ended by them, as its own binary is.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    program = f"{shlex.quote(sys.executable)} -m morphcog"
    sys.exit(command(["morphcog", *sys.argv[1:]], program))
