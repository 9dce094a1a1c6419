"""Joint motions: given, planned, and judged before they are flown."""

from __future__ import annotations

import json
import os
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal, Union

from . import _ffid
from ._options import Array, ArrayLike, Path, Progress, words
from .errors import Problem, problems_of, warn

if TYPE_CHECKING:
    from .mission import Mission


class Motion:
    """A joint motion of a robot."""

    _core: _ffid.Motion
    _mission: Mission

    def __init__(self, core: _ffid.Motion, mission: Mission) -> None:
        self._core = core
        self._mission = mission
        warn(core.warnings(), stacklevel=4)

    @classmethod
    def load(cls, path: Path, mission: Mission) -> Motion:
        """Reads ``trajectory.json`` of ``ffid excite``, or ``.csv``."""
        return cls(_ffid.Motion.load(mission._core, path), mission)

    @classmethod
    def from_arrays(
        cls,
        mission: Mission,
        *,
        t: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
    ) -> Motion:
        """Through samples: times ``(N,)`` (s) from 0, positions ``(N, n)`` (rad or m), and perhaps rates and accelerations. Positions
        alone are fitted by a spline."""
        return cls(_ffid.Motion.from_samples(mission._core, t, q, qd, qdd), mission)

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return self._core.duration

    def __call__(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions, rates and accelerations at times ``t`` ``(N,)`` (s), each ``(N, n)``."""
        return self._core.sample(self._mission._core, t)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.duration:g} s)"


class Preflight:
    """What the record of a motion will tell, and what the motion does to the robot.

    Attributes:
        raw: The verdict as ``verdict.json`` has it: parameters with the standard deviations to come, modes, limits, excursions.
        problems: What it finds fault with.
    """

    raw: dict[str, Any]
    problems: tuple[Problem, ...]

    def __init__(self, verdict: str, text: str, faults: str) -> None:
        self.raw = json.loads(verdict)
        self.problems = problems_of(faults)
        self._text = text

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """Predicted standard deviation of every parameter."""
        rows: list[dict[str, Any]] = self.raw["parameters"]
        return rows

    @property
    def holds(self) -> bool:
        """Whether all limits are kept."""
        return all(limit["holds"] for limit in self.raw["limits"])

    def __str__(self) -> str:
        return self._text


class Plan(Motion):
    """A planned joint motion.

    Attributes:
        raw: How it was found: goal, cost, searches.
        verdict: What its record will tell.
        trajectory: The text of ``trajectory.json``.
    """

    raw: dict[str, Any]
    verdict: Preflight
    trajectory: str

    def __init__(self, mission: Mission, trajectory: str, plan: str, verdict: Preflight) -> None:
        super().__init__(_ffid.Motion.from_json(mission._core, trajectory), mission)
        self.raw = json.loads(plan)
        self.verdict = verdict
        self.trajectory = trajectory

    def save(self, path: Path) -> None:
        """Writes ``trajectory.json``, which reads back exactly."""
        FilePath(os.fspath(path)).write_text(self.trajectory, encoding="utf-8")


Trajectory = Union[Motion, Path, ArrayLike]
"""A motion, a plan, a file, or times beside positions."""


def motion_of(mission: Mission, trajectory: Any, q: ArrayLike | None) -> _ffid.Motion:
    """The motion that an argument means."""
    if isinstance(trajectory, Motion):
        return trajectory._core
    if isinstance(trajectory, (str, os.PathLike)):
        return Motion.load(trajectory, mission)._core
    if q is None:
        raise TypeError("give a motion, a plan, a file, or times and q")
    return Motion.from_arrays(mission, t=trajectory, q=q)._core


def plan_excitation(
    mission: Mission,
    *,
    goal: Literal["information", "modal", "quiet", "paper", "condition"] | None = None,
    seed: int | None = None,
    starts: int | None = None,
    allow: tuple[str, ...] = (),
    strict: bool = False,
    progress: Progress | None = None,
) -> Plan:
    """Plans the manoeuvre of ``[excite]`` within the limits of the mission.

    Args:
        mission: The mission.
        goal: What to plan for, in place of ``excite.goal``.
        seed: Seed, in place of ``excite.seed``.
        starts: Local searches from random plans, in place of ``excite.starts``.
        allow: Errors that are to be warnings, by code.
        strict: Whether warnings are errors.
        progress: Called with stage, iteration and cost.
    """
    options = words(goal=goal, seed=seed, starts=starts, allow=list(allow), strict=strict)
    trajectory, plan, verdict, text, faults = _ffid.plan_excitation(mission._core, options, progress)
    return Plan(mission, trajectory, plan, Preflight(verdict, text, faults))


def preflight(mission: Mission, trajectory: Trajectory, q: ArrayLike | None = None) -> Preflight:
    """Judges a motion before it is flown: a motion, a plan, a file, or times (s) and positions ``(N, n)`` (rad or m)."""
    return Preflight(*motion_of(mission, trajectory, q).preflight(mission._core))
