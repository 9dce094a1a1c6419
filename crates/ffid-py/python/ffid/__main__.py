"""The command ``ffid``, as ``ffid`` or ``python -m ffid``."""

from __future__ import annotations

import signal
import sys

from . import _ffid


def main() -> int:
    """Runs the command line of this process and returns its exit code."""
    # The command handles Ctrl-C itself where it takes long; elsewhere it ends at once.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.stdout.flush()
    return _ffid.main(["ffid", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
