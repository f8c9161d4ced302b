"""Starts a command that is told to end when its parent dies, however that dies.

Run as a script, ``python -IS child.py COMMAND ARGUMENTS...``: it asks the kernel for SIGTERM at
the parent's death (prctl(2), PR_SET_PDEATHSIG, kept over exec) and becomes the command. Doing
this between fork and exec of a program with threads would not be safe.
"""

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1


def main() -> None:
    """Become the command given as arguments."""
    parent, *command = sys.argv[1:]
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):  # it died before the kernel was asked
        sys.exit(1)
    os.execvp(command[0], command)


if __name__ == "__main__":
    main()
