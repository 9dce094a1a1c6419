"""Rows as a data frame, where there is a library for it."""

from __future__ import annotations

from typing import Any


def rows(found: list[dict[str, Any]]) -> Any:
    """A data frame where pandas is installed, else the rows."""
    try:
        import pandas
    except ImportError:
        return found
    return pandas.DataFrame(found)
