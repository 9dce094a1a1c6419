"""Joint motions: given and planned, and what their records will tell."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any, Union

from . import _ffid
from ._mission_like import MissionLike
from ._options import Array, ArrayLike, Path, core_of
from .errors import Problem, problems_of, warn


class Motion:
    """A joint motion of a robot."""

    _core: _ffid.Motion
    _mission: MissionLike

    def __init__(self, core: _ffid.Motion, mission: MissionLike) -> None:
        self._core = core
        self._mission = mission
        warn(core.warnings(), stacklevel=4)

    @classmethod
    def load(cls, path: Path, mission: MissionLike) -> Motion:
        """Reads ``trajectory.json`` of ``ffid excite``, or ``.csv``.

        Args:
            path: The file.
            mission: The robot that moves.
        """
        return cls(_ffid.Motion.load(core_of(mission), path), mission)

    @classmethod
    def from_arrays(
        cls,
        mission: MissionLike,
        *,
        t: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
    ) -> Motion:
        """Through samples in the order of the mission's joints. Positions alone are fitted by a spline.

        Args:
            mission: The robot that moves.
            t: Times ``(N,)`` (s), from 0.
            q: Positions ``(N, n)`` (rad or m).
            qd: Rates ``(N, n)`` (rad/s or m/s); with ``qdd`` or not at all.
            qdd: Accelerations ``(N, n)`` (rad/s^2 or m/s^2).
        """
        return cls(_ffid.Motion.from_samples(core_of(mission), t, q, qd, qdd), mission)

    @classmethod
    def from_function(
        cls, mission: MissionLike, f: Callable[[float], ArrayLike], duration: float, *, rate_hz: float = 200.0
    ) -> Motion:
        """Of a Python function, which is sampled once; a spline goes through the samples.

        Args:
            mission: The robot that moves.
            f: Called with a time (s); returns the positions of all joints ``(n,)`` (rad or m). The motion should be smooth: what it does
                within a sample is lost.
            duration: How long it lasts (s).
            rate_hz: How often it is sampled (Hz).
        """
        import numpy as np

        if not (0.0 < duration < float("inf")) or not (0.0 < rate_hz < float("inf")):
            raise ValueError(f"duration {duration} s at {rate_hz} Hz; both must be above 0 and finite")
        count = duration * rate_hz
        if count > 1e7:
            raise ValueError(f"{count:.3g} samples, limit 1e7; sample at a lower rate")
        t = np.linspace(0.0, duration, max(2, round(count) + 1))
        n = len(mission.joints)
        q = np.empty((len(t), n))
        for i, at in enumerate(t):
            row = np.asarray(f(float(at)), dtype=np.float64)
            if row.shape != (n,):
                raise ValueError(f"the function returns an array of shape {row.shape} at {at:g} s, ({n},) is needed: a position for each joint")
            q[i] = row
        return cls.from_arrays(mission, t=t, q=q)

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return self._core.duration

    def __call__(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions (rad or m), rates and accelerations at times, each ``(N, n)``.

        Args:
            t: Times ``(N,)`` (s), from 0 to :attr:`duration`.
        """
        return self._core.sample(self._mission._core, t)

    def _csv(self, rate_hz: float = 100.0) -> str:
        """The motion as a CSV file that :meth:`load` reads."""
        import numpy as np

        t = np.linspace(0.0, self.duration, max(2, round(self.duration * rate_hz) + 1))
        joints, model = self._mission.joints, self._mission.model
        units = [("m" if slides else "rad") for slides in model._about["slides"]]
        head = ["time[s]"]
        for prefix, per in (("q", ""), ("qd", "/s"), ("qdd", "/s^2")):
            head += [f"{prefix}.{joint}[{unit}{per}]" for joint, unit in zip(joints, units)]
        rows = np.column_stack([t, *self(t)]).tolist()
        return "\n".join([",".join(head), *(",".join(map(repr, row)) for row in rows), ""])

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

    @property
    def std(self) -> dict[str, float | None]:
        """Predicted standard deviation of every parameter, by name (SI units); none where the record will not tell."""
        return {p["name"]: p.get("std") for p in self.raw["parameters"]}

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self._text)}</pre>"

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

    def __init__(self, mission: MissionLike, trajectory: str, plan: str, verdict: Preflight) -> None:
        super().__init__(_ffid.Motion.from_json(core_of(mission), trajectory), mission)
        self.raw = json.loads(plan)
        self.verdict = verdict
        self.trajectory = trajectory

    def save(self, path: Path) -> None:
        """Writes ``trajectory.json``, which reads back exactly.

        Args:
            path: The file; one that exists is replaced.
        """
        FilePath(os.fspath(path)).write_text(self.trajectory, encoding="utf-8")


Trajectory = Union[Motion, Path, ArrayLike]
"""A motion, a plan, a file, or times beside positions."""


def motion_of(mission: MissionLike, trajectory: Any, q: ArrayLike | None) -> _ffid.Motion:
    """The motion that an argument means."""
    if isinstance(trajectory, Motion):
        return trajectory._core
    if isinstance(trajectory, (str, os.PathLike)):
        return Motion.load(trajectory, mission)._core
    if q is None:
        raise TypeError("give a motion, a plan, a file, or times and q")
    return Motion.from_arrays(mission, t=trajectory, q=q)._core
