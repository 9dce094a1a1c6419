"""Keyword arguments as options of the command line, and what is typed alike everywhere."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any, Union

import numpy as np
import numpy.typing as npt

Path = Union[str, "os.PathLike[str]"]
"""A path of a file or folder."""
Array = npt.NDArray[np.float64]
"""An array of float64."""
ArrayLike = npt.ArrayLike
"""What NumPy makes an array of."""
Progress = Callable[[str, int, float], object]
"""Called with what is done, how often (linearisations or iterations) and its cost (chi-squared per residual, or the cost of a plan)."""


def words(**keywords: Any) -> list[str]:
    """Options of the command line: ``held_out=0.3`` is ``--held-out=0.3``, ``True`` a flag, ``None`` and ``False`` nothing."""
    out: list[str] = []
    for key, value in keywords.items():
        option = "--" + key.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            out.append(option)
        elif isinstance(value, (str, os.PathLike)):
            out.append(f"{option}={os.fspath(value)}")
        elif isinstance(value, Iterable):
            out.extend(f"{option}={os.fspath(v) if isinstance(v, os.PathLike) else v}" for v in value)
        else:
            out.append(f"{option}={value}")
    return out
