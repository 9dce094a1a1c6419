"""Commands that work on files: what they print, as values."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, Literal

from . import _ffid
from ._options import Path, words, words_of
from .errors import Problem, from_json, problems_of, warn_of


def run(command: str, *arguments: Path, **options: Any) -> tuple[dict[str, Any], tuple[Problem, ...]]:
    """Runs a command of ``ffid`` and returns what it prints as JSON, and its problems; nothing is printed.

    Raises:
        FfidError: With the problems of the command.
    """
    given = [*(os.fspath(a) for a in arguments), *words(**options), "--json"]
    exit_code, text, complaint = _ffid.command([command, *given])
    try:
        printed: dict[str, Any] = json.loads(text)
        problems = printed["problems"]
    except (ValueError, KeyError):
        # Wrong usage is said in words.
        what = (complaint.splitlines() or ["no output"])[0].removeprefix("error: ")
        printed, problems = {}, [{"code": "Config::Option", "severity": "error", "area": "config", "message": what}]
    if exit_code != 0:
        raise from_json(json.dumps(problems), exit_code)
    return printed, problems_of(json.dumps(problems))


def run_command(command: str, *arguments: Path, **options: Any) -> dict[str, Any]:
    """:func:`run`, with its warnings issued."""
    printed, problems = run(command, *arguments, **options)
    warn_of([p for p in problems if p.severity == "warning"], stacklevel=4)
    return printed


def convert(
    source: Path,
    to: Path,
    *,
    with_: Sequence[Path] = (),
    si: bool = False,
    separator: Literal["commas", "semicolons", "tabs", "bars", "blanks"] = "commas",
    rename: Sequence[str] = (),
    dates: Literal["day-first", "month-first"] | None = None,
    ignore: Sequence[str] = (),
    topic: Sequence[str] = (),
    slides: Sequence[str] = (),
    max_bytes: int | None = None,
    allow: Sequence[str] = (),
    strict: bool = False,
    force: bool = False,
) -> dict[str, Any]:
    """Converts a record between CSV and Parquet, or from a ROS 2 bag (MCAP); returns what was written.

    Args:
        source: The file that is read.
        to: The file that is written, ``.csv`` or ``.parquet``.
        with_: Other files of the same motion, with stamps of the same clock: rows of all in the order of their time, empty cells where one has no sample.
        si: Whether every column is converted to its SI unit.
        separator: What separates the columns of a CSV file; with any but commas, a comma in a number is a decimal comma.
        rename: Columns to call otherwise, ``"timestamp=time[ns]"``; one ``*`` stands for any text, as in ``"pos_*=q.*[deg]"``.
        dates: What 3/5/2024 is, where no row of the file settles it.
        ignore: Columns to leave out; one ``*`` stands for any text.
        topic: Topics of an MCAP file.
        slides: Joints of an MCAP file that slide: their columns are in m and N.
        max_bytes: Longest file that is read (bytes).
        allow: Errors that are to be warnings, by code.
        strict: Whether warnings are errors.
        force: Whether ``to`` may replace a file.
    """
    return run_command("convert", source, to, *words_of(convert, locals()))


def schema(of: Literal["mission", "result"]) -> dict[str, Any]:
    """The JSON schema of a mission file or of ``result.json``.

    Args:
        of: Which.
    """
    exit_code, text, complaint = _ffid.command(["schema", of])
    if exit_code != 0:
        raise ValueError((complaint.splitlines() or ["no such schema"])[0].removeprefix("error: "))
    found: dict[str, Any] = json.loads(text)
    return found


def appendage_kinds() -> list[str]:
    """All kinds of appendage that a mission may have, those that this build brings of its own included."""
    return _ffid.appendage_kinds()
