"""What long computations do, for who reads it by :mod:`logging`."""

from __future__ import annotations

import logging

from ._options import Progress

LOG = logging.getLogger("ffid")
# Nothing is printed unasked.
LOG.addHandler(logging.NullHandler())


def logged(progress: Progress | None) -> Progress | None:
    """What a computation calls with its reports: ``progress``, and a line of the log for each where somebody listens to these."""
    if not LOG.isEnabledFor(logging.DEBUG):
        return progress

    def report(stage: str, count: int, value: float) -> None:
        LOG.debug("%s: step %d, %.6g", stage, count, value)
        if progress is not None:
            progress(stage, count, value)

    return report
