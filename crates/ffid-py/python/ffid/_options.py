"""Keyword arguments as options of the command line, and what is typed alike everywhere."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _ffid

Path = Union[str, "os.PathLike[str]"]
"""A path of a file or folder."""
Array = npt.NDArray[np.float64]
"""An array of float64."""
ArrayLike = npt.ArrayLike
"""What NumPy makes an array of."""
Progress = Callable[[str, int, float], object]
"""Called with what is done, how often (linearisations or iterations) and its cost (chi-squared per residual, or the cost of a plan)."""


def core_of(mission: Any) -> _ffid.Mission:
    """The compiled part of a mission, or why there is none."""
    core = getattr(mission, "_core", None)
    if not isinstance(core, _ffid.Mission):
        raise TypeError(f"a Mission is needed, not {type(mission).__name__}; Mission.load reads one from a file")
    return core


def several(names: str | Iterable[str]) -> list[str]:
    """Names of which one alone may stand for itself."""
    return [names] if isinstance(names, str) else list(names)


def words_of(function: Callable[..., object], values: Mapping[str, Any], *, leave: Iterable[str] = ()) -> list[str]:
    """Keyword arguments of a function as :func:`words`, so that its signature is the one list of them.

    Args:
        function: The function.
        values: Its ``locals()``.
        leave: Keywords that are no options of the command.
    """
    named = [p.name for p in inspect.signature(function).parameters.values() if p.kind is p.KEYWORD_ONLY]
    return words(**{name: values[name] for name in named if name not in leave})


def words(**keywords: Any) -> list[str]:
    """Options of the command line: ``held_out=0.3`` is ``--held-out=0.3``, ``with_=`` is ``--with``, ``True`` a flag, ``None`` and ``False`` nothing."""
    out: list[str] = []
    for key, value in keywords.items():
        option = "--" + key.rstrip("_").replace("_", "-")
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
