"""Records: joint motion, joint torques and base gyro over time."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from . import _ffid
from ._options import Array, ArrayLike, Path, words
from .errors import warn

if TYPE_CHECKING:
    from .mission import Mission


class Record:
    """A record of a robot, checked: every number is finite, every clock runs. Arrays have one sample per row."""

    _core: _ffid.Record

    def __init__(self, core: _ffid.Record) -> None:
        self._core = core

    @classmethod
    def read(
        cls,
        path: Path,
        mission: Mission,
        *,
        resample: bool = False,
        gaps: Literal["refuse", "drop"] = "refuse",
        drop_repeated: bool = False,
        keep_spikes: bool = False,
        ignore: Sequence[str] = (),
        topic: Sequence[str] = (),
        stamps: Literal["header", "receive"] = "header",
        max_rows: int | None = None,
        max_bytes: int | None = None,
        allow: Sequence[str] = (),
        strict: bool = False,
    ) -> Record:
        """Reads CSV, Parquet, or a bag of ROS 1 or ROS 2 (MCAP).

        Args:
            path: The file.
            mission: The robot that it is of.
            resample: Whether to interpolate jittered samples and gaps of up to 1 % of the record.
            gaps: What to do with rows that have NaN, infinite or empty cells.
            drop_repeated: Whether to leave out rows that repeat the one before.
            keep_spikes: Whether samples far off their neighbours are fitted, which are left out and counted otherwise.
            ignore: Columns to leave out.
            topic: Topics of a bag to read.
            stamps: Whether messages of a bag count at the stamps in their headers or at the times of recording.
            max_rows: Most rows.
            max_bytes: Longest file (bytes).
            allow: Errors that are to be warnings, by code, such as ``stuck``.
            strict: Whether warnings are errors.
        """
        options = words(
            resample=resample,
            gaps=gaps,
            drop_repeated=drop_repeated,
            keep_spikes=keep_spikes,
            ignore=list(ignore),
            topic=list(topic),
            stamps=stamps,
            max_rows=max_rows,
            max_bytes=max_bytes,
            allow=list(allow),
            strict=strict,
        )
        core = _ffid.Record.read(mission._core, path, options)
        warn(core.warnings())
        return cls(core)

    @classmethod
    def from_arrays(
        cls,
        mission: Mission,
        *,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        gyro: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        att: ArrayLike | None = None,
        name: str = "arrays",
        resample: bool = False,
        allow: Sequence[str] = (),
    ) -> Record:
        """A record from arrays in the order of the mission's joints.

        Args:
            mission: The robot that it is of.
            t: Sample times ``(N,)`` (s).
            q: Joint positions ``(N, n)`` (rad or m).
            tau: Joint torques ``(N, n)`` (N m or N).
            gyro: Base angular velocity in base axes ``(N, 3)`` (rad/s); needed unless the base is fixed.
            qd: Joint rates ``(N, n)``.
            qdd: Joint accelerations ``(N, n)``.
            acc: Base specific force in base axes ``(N, 3)`` (m/s^2).
            att: Base attitude ``w x y z`` ``(N, 4)``.
            name: What it is called; prefix of its biases where there are several records.
            resample: Whether to interpolate jittered samples and gaps of up to 1 % of the record.
            allow: Errors that are to be warnings, by code, such as ``stuck``.

        Raises:
            ArrayError: For a wrong type, shape or number, with the name of the argument as ``problem.object``.
            DataError: With everything that is wrong with the samples.
        """
        arrays = {"t": t, "q": q, "tau": tau, "gyro": gyro, "qd": qd, "qdd": qdd, "acc": acc, "att": att}
        core = _ffid.Record.build(mission._core, name, arrays, resample, list(allow))
        warn(core.warnings())
        return cls(core)

    @classmethod
    def from_pandas(cls, mission: Mission, frame: Any, **options: Any) -> Record:
        """A record from a data frame of pandas with the columns of a CSV record in SI units: ``time`` (or a time index), ``q.<joint>``,
        ``tau.<joint>``, ``gyro.x`` .. ``gyro.z``, and perhaps ``dq.``, ``ddq.``, ``acc.``, ``att.w`` ..; units in brackets are dropped if
        they are SI. ``options`` are those of :meth:`from_arrays`."""
        columns = {str(c): frame[c].to_numpy() for c in frame.columns}
        if not any(_plain(c) == "time" for c in columns):
            index = frame.index
            columns["time"] = index.total_seconds().to_numpy() if hasattr(index, "total_seconds") else index.to_numpy()
        return cls._from_columns(mission, columns, **options)

    @classmethod
    def from_polars(cls, mission: Mission, frame: Any, **options: Any) -> Record:
        """A record from a data frame of polars; columns as for :meth:`from_pandas`."""
        return cls._from_columns(mission, {c: frame[c].to_numpy() for c in frame.columns}, **options)

    @classmethod
    def _from_columns(cls, mission: Mission, columns: Mapping[str, Any], **options: Any) -> Record:
        import numpy as np

        named = {}
        for column, values in columns.items():
            unit = column[column.index("[") + 1 : -1] if column.endswith("]") and "[" in column else None
            if unit is not None and unit not in _SI:
                raise ValueError(f"column {column!r}: unit {unit!r}; convert it to SI, or write a CSV file, whose units are converted")
            named[_plain(column)] = values

        def channel(prefix: str, parts: Sequence[str]) -> Any:
            found = [f"{prefix}.{p}" for p in parts if f"{prefix}.{p}" in named]
            if not found:
                return None
            lacking = [f"{prefix}.{p}" for p in parts if f"{prefix}.{p}" not in named]
            if lacking:
                raise ValueError(f"columns {', '.join(lacking)} are lacking beside {found[0]}")
            return np.column_stack([named[c] for c in found])

        joints = mission.joints
        axes = ["x", "y", "z"]
        q, tau = channel("q", joints), channel("tau", joints)
        if q is None or tau is None or "time" not in named:
            raise ValueError("columns time, q.<joint> and tau.<joint> are needed; the joints are " + ", ".join(joints))
        return cls.from_arrays(
            mission,
            t=named["time"],
            q=q,
            tau=tau,
            gyro=channel("gyro", axes),
            qd=channel("dq", joints),
            qdd=channel("ddq", joints),
            acc=channel("acc", axes),
            att=channel("att", ["w", *axes]),
            **options,
        )

    @property
    def name(self) -> str:
        """Its file, or what else it is called."""
        return os.fspath(self._core.name)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self._core.clock()[0]

    @property
    def rate_hz(self) -> float:
        """Sample rate (Hz)."""
        return self._core.clock()[1]

    def _need(self, channel: str) -> Array:
        x = self._core.channel(channel)
        assert x is not None
        return x

    @property
    def t(self) -> Array:
        """Sample times ``(N,)`` (s)."""
        return self._need("t")

    @property
    def q(self) -> Array:
        """Joint positions ``(N, n)`` (rad or m)."""
        return self._need("q")

    @property
    def tau(self) -> Array:
        """Joint torques ``(N, n)`` (N m or N)."""
        return self._need("tau")

    @property
    def gyro(self) -> Array | None:
        """Base angular velocity in base axes ``(N, 3)`` (rad/s); none for a fixed base."""
        return self._core.channel("gyro")

    @property
    def qd(self) -> Array | None:
        """Joint rates ``(N, n)``, where they were recorded."""
        return self._core.channel("qd")

    @property
    def qdd(self) -> Array | None:
        """Joint accelerations ``(N, n)``, where they were recorded."""
        return self._core.channel("qdd")

    @property
    def acc(self) -> Array | None:
        """Base specific force in base axes ``(N, 3)`` (m/s^2), where it was recorded."""
        return self._core.channel("acc")

    @property
    def att(self) -> Array | None:
        """Base attitude ``w x y z`` ``(N, 4)``, where it was recorded."""
        return self._core.channel("att")

    def __len__(self) -> int:
        return self.samples

    def __repr__(self) -> str:
        n, rate, _ = self._core.clock()
        return f"Record({self.name!r}, {n} samples at {rate:g} Hz)"


_SI = {"s", "rad", "rad/s", "rad/s^2", "m", "m/s", "m/s^2", "N m", "Nm", "N", "1", ""}


def _plain(column: str) -> str:
    """The name of a column without its unit."""
    name = column.split("[")[0].strip()
    return "time" if name == "t" else name
