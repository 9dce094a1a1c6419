"""The doctor: can a record be true, and is it one of this robot, before anything is fitted?"""

from __future__ import annotations

import html
import json
import os
from collections.abc import Sequence
from typing import Any, Union

from . import _ffid
from ._options import Path, core_of, words_of
from .errors import Problem, problems_of
from .mission import Mission
from .record import Record
from .table import rows

Records = Union[Record, Path, Sequence[Union[Record, Path]]]
"""A record or a file, or several of one robot."""


class Diagnosis:
    """What a record looks like against its mission, before anything is fitted.

    Attributes:
        raw: As ``ffid doctor --json`` has it.
        problems: What was put up with in reading, and what the findings give rise to.
        exit_code: What ``ffid doctor`` would end with: 0, 12 (wrong) or 13 (nothing moves).
    """

    raw: dict[str, Any]
    problems: tuple[Problem, ...]
    exit_code: int

    def __init__(self, diagnosis: str, text: str, problems: str, exit_code: int) -> None:
        self.raw = json.loads(diagnosis)
        self.problems = problems_of(problems)
        self.exit_code = exit_code
        self._text = text

    @property
    def judgement(self) -> str:
        """The worst finding: ``good``, ``suspicious`` or ``wrong``."""
        return str(self.raw["judgement"])

    @property
    def findings(self) -> Any:
        """Every finding: record, topic, channel, judgement, measured, expected, unit, text. A data frame where pandas is installed, else a
        :class:`Table`."""
        columns = ("record", "topic", "channel", "judgement", "measured", "expected", "unit", "text")
        return rows([{c: f.get(c) for c in columns} for f in self.raw["findings"]])

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"Diagnosis({self.judgement!r}, {len(self.raw['findings'])} findings)"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self._text)}</pre>"


def read_all(records: Records, mission: Mission, **options: Any) -> list[Record]:
    """Records, those that are files read with options of :meth:`Record.read`."""
    core_of(mission)
    if not isinstance(records, (Record, str, os.PathLike, list, tuple)):
        # A data frame or a dictionary would be taken for its column names.
        what = f"records are a Record, a path, or a list of them, not {type(records).__name__}"
        raise TypeError(f"{what}; Record.from_arrays and from_pandas make one")
    several = [records] if isinstance(records, (Record, str, os.PathLike)) else list(records)
    if not several:
        raise ValueError("no records; give one or more")
    for r in several:
        if not isinstance(r, (Record, str, os.PathLike)):
            raise TypeError(f"a record is a Record or a path, not {type(r).__name__}; Record.from_arrays makes one of arrays")
    return [r if isinstance(r, Record) else Record.read(r, mission, **options) for r in several]


def doctor(
    mission: Mission,
    records: Records,
    *,
    torque_noise: float | None = None,
    current_noise: float | None = None,
    gyro_noise: float | None = None,
    no_biases: bool = False,
    initial_state: bool = False,
    max_iterations: int | None = None,
    max_chi2: float | None = None,
    low_pass: float | None = None,
    allow: Sequence[str] = (),
    strict: bool = False,
) -> Diagnosis:
    """Judges records before anything is fitted: units, axes, signs, rest, excitation, noise, gaps, clocks, modes.

    Nothing is raised for what is wrong with a record: :attr:`Diagnosis.judgement` says it.

    Args:
        mission: The mission.
        records: A record or a file, or several.
        torque_noise: Standard deviation of one torque sample (N m), in place of the mission's.
        current_noise: Standard deviation of one sample of a motor current (A), in place of the mission's.
        gyro_noise: Standard deviation of one gyro sample (rad/s), in place of the mission's.
        no_biases: Take gyro and torque sensors as free of bias.
        initial_state: Estimate base rate and appendages at the first sample; at rest unless given.
        max_iterations: Most linearisations of the quick fits.
        max_chi2: Largest chi-squared per degree of freedom that counts as explained.
        low_pass: Cutoff of the filter of motion, torques and equations (Hz), for arms on the ground.
        allow: Errors that are to be warnings, by code, such as ``unit-mismatch``.
        strict: Whether warnings are errors.

    Raises:
        FfidError: When the mission is refused, or a file is no record.
    """
    given = read_all(records, mission, allow=allow, strict=strict)
    options = words_of(doctor, locals())
    return Diagnosis(*_ffid.doctor(mission._core, [r._core for r in given], options))
