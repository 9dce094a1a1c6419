"""Errors with their problems, each with code, place, value, limit, unit and one next step; warnings."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        code: Stable name of the kind of problem, such as ``Data::Gap``.
        severity: ``error`` or ``warning``.
        area: ``model``, ``config``, ``data`` or ``io``.
        message: What is wrong, with value, limit and unit.
        file: The file, where there is one.
        line: Line in the file, from 1.
        column: Column in the line, from 1.
        object: The link, joint, key, channel, argument or parameter concerned.
        value: The number that breaks a limit, where a single number does.
        limit: What it may be, such as ``{"above": 0.0}``.
        unit: Unit of value and limit.
        next_step: What to do about it.
    """

    code: str
    severity: str
    area: str
    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None
    object: str | None = None
    value: float | None = None
    limit: dict[str, Any] | None = None
    unit: str | None = None
    next_step: str | None = None

    @property
    def place(self) -> str:
        """File, line, column and object, as far as they are known."""
        at = [self.file, self.line, self.column]
        where = ":".join(str(x) for x in at if x is not None)
        return " ".join(x for x in (where, self.object or "") if x)

    def __str__(self) -> str:
        place = f"{self.place}: " if self.place else ""
        step = f"; {self.next_step}" if self.next_step else ""
        return f"{self.severity}[{self.code}] {place}{self.message}{step}"

    @classmethod
    def _of(cls, raw: dict[str, Any]) -> Problem:
        violation = raw.get("violation") or {}
        return cls(
            code=raw["code"],
            severity=raw["severity"],
            area=raw["area"],
            message=_as_keywords(raw["message"]),
            file=raw.get("file"),
            line=raw.get("line"),
            column=raw.get("column"),
            object=None if raw.get("object") is None else _as_keywords(raw["object"]),
            value=violation.get("value"),
            limit=violation.get("limit"),
            unit=violation.get("unit"),
            next_step=None if raw.get("hint") is None else _as_keywords(raw["hint"]),
        )


# Flags, options whose value is a word or a number, and options that are arguments of another name.
_FLAGS = "resample|keep-spikes|drop-repeated|no-prior|no-biases|initial-state|consider|reduce|external-torque|modes|no-start-offset|force|strict"
_LISTS = "allow|rename|ignore|topic|profile|adopt|compare"
_OBJECTS = {"out": "folder", "record": "record", "records": "records", "trajectory": "trajectory"}


def _as_keywords(text: str) -> str:
    """Options of the command line in a message as keywords: ``--gaps drop`` is ``gaps="drop"``, ``--resample`` is ``resample=True``. What is in
    backquotes is a command, and stays."""
    return "`".join(part if i % 2 else _outside(part) for i, part in enumerate(text.split("`")))


def _outside(text: str) -> str:

    def name(option: str) -> str:
        return _OBJECTS.get(option, option.replace("-", "_"))

    def valued(found: re.Match[str]) -> str:
        option, value = found.groups()
        quoted = value if re.fullmatch(r"[-+.0-9e]+", value) else f'"{value}"'
        return f"{name(option)}={f'[{quoted}]' if option in _LISTS.split('|') else quoted}"

    text = re.sub(rf"--({_FLAGS})(?![-\w])", lambda m: f"{name(m.group(1))}=True", text)
    text = re.sub(rf"--({_LISTS}) ([a-z][-a-z0-9.*]*[-.*][-a-z0-9.*]*|stuck|triangle)(?![-\w])", valued, text)
    text = re.sub(r"--(rename|ignore) '([^']*)'", r'\1=["\2"]', text)
    text = re.sub(r"--(separator|dates) (semicolons|tabs|bars|blanks|day-first|month-first)\b", valued, text)
    text = re.sub(r"--(gaps|clocks|method|loss) (drop|refuse|trust|require|correct|rda|output-error|ground|huber|student)\b", valued, text)
    text = re.sub(r"--(low-pass|held-out|starts|max-iterations|prior|max-rows|max-bytes) ([0-9][.0-9e]*[0-9]|[0-9])", valued, text)
    return re.sub(r"--([a-z][-a-z]*[a-z])", lambda m: name(m.group(1)), text)


class FfidError(Exception):
    """Something was refused or failed.

    Attributes:
        problems: Everything that was found, errors and warnings.
        exit_code: The code that the command ``ffid`` would end with.
    """

    problems: tuple[Problem, ...]
    exit_code: int

    def __init__(self, problems: tuple[Problem, ...], exit_code: int) -> None:
        super().__init__("\n".join(str(p) for p in problems))
        self.problems = problems
        self.exit_code = exit_code

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.problems, self.exit_code))

    @property
    def first(self) -> Problem:
        """The first error."""
        errors = [p for p in self.problems if p.severity == "error"]
        return (errors or list(self.problems))[0]

    @property
    def code(self) -> str:
        """Code of the first error."""
        return self.first.code

    @property
    def place(self) -> str:
        """Place of the first error."""
        return self.first.place

    @property
    def value(self) -> float | None:
        """The number that breaks a limit in the first error, where a single number does."""
        return self.first.value

    @property
    def limit(self) -> dict[str, Any] | None:
        """What that number may be."""
        return self.first.limit

    @property
    def unit(self) -> str | None:
        """Unit of value and limit of the first error."""
        return self.first.unit

    @property
    def next_step(self) -> str | None:
        """What to do about the first error."""
        return self.first.next_step


class ModelError(FfidError):
    """The robot model is invalid (exit code 10)."""


class ConfigError(FfidError, ValueError):
    """A mission or an argument is invalid (exit codes 2 and 11)."""


class DataError(FfidError, ValueError):
    """Data are invalid (exit code 12)."""


class ArrayError(DataError):
    """An array has the wrong type, shape, layout or size, or a number that is not finite."""


class IllPosedError(FfidError):
    """The question cannot be answered from these data (exit code 13)."""


class NumericalError(FfidError, ArithmeticError):
    """A computation failed (exit code 14)."""


class OutputError(FfidError, OSError):
    """Reading or writing failed, or another run holds the lock (exit codes 20 and 21)."""

    def __init__(self, problems: tuple[Problem, ...], exit_code: int) -> None:
        FfidError.__init__(self, problems, exit_code)

    def __str__(self) -> str:
        return "\n".join(str(p) for p in self.problems)


class InternalError(FfidError, RuntimeError):
    """A bug of ffid; please report it."""


class FfidWarning(UserWarning):
    """Something that was put up with.

    Attributes:
        problem: What it is.
    """

    problem: Problem

    def __init__(self, problem: Problem) -> None:
        super().__init__(str(problem))
        self.problem = problem


_BY_EXIT: dict[int, type[FfidError]] = {
    1: InternalError,
    2: ConfigError,
    10: ModelError,
    11: ConfigError,
    12: DataError,
    13: IllPosedError,
    14: NumericalError,
    20: OutputError,
    21: OutputError,
}


def problems_of(text: str) -> tuple[Problem, ...]:
    """Problems from the JSON text of a command."""
    return tuple(Problem._of(p) for p in json.loads(text))


def from_json(text: str, exit_code: int) -> FfidError:
    """The exception for problems and an exit code."""
    problems = problems_of(text)
    kind = _BY_EXIT.get(exit_code, FfidError)
    if any(p.code.startswith("Internal::") for p in problems):
        kind = InternalError
    elif kind is DataError and all(p.code.startswith("Array::") for p in problems):
        kind = ArrayError
    return kind(problems, exit_code)


def warn_of(problems: Iterable[Problem], stacklevel: int = 3) -> None:
    """Issues a :class:`FfidWarning` for every problem."""
    for p in problems:
        warnings.warn(FfidWarning(p), stacklevel=stacklevel)


def warn(text: str, stacklevel: int = 3) -> tuple[Problem, ...]:
    """Issues a :class:`FfidWarning` for every warning in the JSON text of problems, which are returned."""
    problems = problems_of(text)
    warn_of((p for p in problems if p.severity == "warning"), stacklevel + 1)
    return problems
