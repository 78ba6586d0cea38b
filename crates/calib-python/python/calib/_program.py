"""The program ``calib``: the native code of this package, run as a command."""

import signal
import sys

from calib import _native


def main() -> int:
    """Runs the command line; the exit code."""
    # The program's own answer to Ctrl-C, not Python's: it ends at once, or where `calib record` says so.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.main(["calib", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
