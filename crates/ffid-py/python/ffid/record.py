"""Records: joint motion, joint torques and base gyro over time."""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from . import _ffid
from ._mission_like import MissionLike
from ._options import Array, ArrayLike, Path, core_of, several, words, words_of
from .errors import warn


class Record:
    """A record of a robot, checked: every number is finite, every clock runs. Arrays have one sample per row."""

    _core: _ffid.Record

    def __init__(self, core: _ffid.Record) -> None:
        self._core = core

    @classmethod
    def read(
        cls,
        path: Path,
        mission: MissionLike,
        *,
        resample: bool = False,
        gaps: Literal["refuse", "drop"] = "refuse",
        drop_repeated: bool = False,
        keep_spikes: bool = False,
        separator: Literal["commas", "semicolons", "tabs", "bars", "blanks"] = "commas",
        rename: Sequence[str] = (),
        dates: Literal["day-first", "month-first"] | None = None,
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
            separator: What separates the columns of a CSV file; with any but commas, a comma in a number is a decimal comma.
            rename: Columns to call otherwise, ``"timestamp=time[ns]"``; one ``*`` stands for any text, as in ``"pos_*=q.*[deg]"``.
            dates: What 3/5/2024 is, where no row of the file settles it.
            ignore: Columns to leave out; one ``*`` stands for any text.
            topic: Topics of a bag to read.
            stamps: Whether messages of a bag count at the stamps in their headers or at the times of recording.
            max_rows: Most rows.
            max_bytes: Longest file (bytes).
            allow: Errors that are to be warnings, by code, such as ``stuck``.
            strict: Whether warnings are errors.
        """
        options = words_of(cls.read, locals())
        core = _ffid.Record.read(core_of(mission), path, options)
        warn(core.warnings())
        return cls(core)

    @classmethod
    def from_mcap(cls, path: Path, mission: MissionLike, *, topic: Sequence[str] = (), **options: Any) -> Record:
        """Reads a ROS 2 bag in MCAP: ``sensor_msgs/JointState`` and ``sensor_msgs/Imu``.

        Args:
            path: The file.
            mission: The robot that it is of.
            topic: Topics to read, where the file has several of a kind.
            options: Those of :meth:`read`.
        """
        return cls.read(path, mission, topic=topic, **options)

    @classmethod
    def from_arrays(
        cls,
        mission: MissionLike,
        *,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        gyro: ArrayLike | None = None,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        att: ArrayLike | None = None,
        t_tau: ArrayLike | None = None,
        t_gyro: ArrayLike | None = None,
        t_acc: ArrayLike | None = None,
        t_att: ArrayLike | None = None,
        name: str = "arrays",
        resample: bool = False,
        keep_spikes: bool = False,
        allow: Sequence[str] = (),
    ) -> Record:
        """A record from arrays in the order of the mission's joints. Samples that were lost or came late need no flag: they count at their
        own times.

        Args:
            mission: The robot that it is of.
            t: Sample times ``(N,)`` (s).
            q: Joint positions ``(N, n)`` (rad or m).
            tau: Joint torques ``(N, n)`` (N m or N), of the motor on the joint after the gear.
            gyro: Base angular velocity in base axes ``(N, 3)`` (rad/s); needed unless the base is fixed.
            qd: Joint rates ``(N, n)`` (rad/s or m/s).
            qdd: Joint accelerations ``(N, n)`` (rad/s^2 or m/s^2).
            acc: Base specific force in base axes ``(N, 3)`` (m/s^2).
            att: Base attitude ``w x y z`` ``(N, 4)``, body to world.
            t_tau: Times of ``tau`` ``(M,)`` (s), where it was sampled at times of its own; ``tau`` then is ``(M, n)``.
            t_gyro: Times of ``gyro``, likewise.
            t_acc: Times of ``acc``, likewise.
            t_att: Times of ``att``, likewise.
            name: What it is called; prefix of its biases where there are several records.
            resample: Whether to interpolate jittered samples and gaps of up to 1 % of the record.
            keep_spikes: Whether samples far off their neighbours are fitted, which are left out and counted otherwise.
            allow: Errors that are to be warnings, by code, such as ``stuck``.

        Raises:
            ArrayError: For a wrong type, shape or number, with the name of the argument as ``problem.object``.
            DataError: With everything that is wrong with the samples.
        """
        arrays = {"t": t, "q": q, "tau": tau, "gyro": gyro, "qd": qd, "qdd": qdd, "acc": acc, "att": att}
        arrays |= {"t_tau": t_tau, "t_gyro": t_gyro, "t_acc": t_acc, "t_att": t_att}
        core = _ffid.Record.build(core_of(mission), name, arrays, resample, keep_spikes, several(allow))
        warn(core.warnings())
        return cls(core)

    @classmethod
    def from_pandas(cls, mission: MissionLike, frame: Any, *, name: str = "frame", **options: Any) -> Record:
        """A record from a data frame of pandas with the columns of a CSV record: ``time`` (or the index), ``q.<joint>``, ``tau.<joint>``,
        ``gyro.x`` .. ``gyro.z``, and perhaps ``dq.``, ``ddq.``, ``acc.``, ``att.w`` ... It is read as a file of these columns would be: a name
        may end in a unit (``q.elbow[deg]``), SI unless it does; missing cells (NaN) of channels that were sampled more slowly are no samples.
        Columns of other names are left out; date-times count from the first.

        Args:
            mission: The robot that it is of.
            frame: The data frame, a sample per row.
            name: What it is called; prefix of its biases where there are several records.
            options: Those of :meth:`read` but ``topic``.
        """
        columns = {str(c): frame[c].to_numpy() for c in frame.columns}
        if not any(_is_time(c) for c in columns):
            columns["time"] = frame.index.to_numpy()
        return cls._from_columns(mission, columns, name, options)

    @classmethod
    def from_polars(cls, mission: MissionLike, frame: Any, *, name: str = "frame", **options: Any) -> Record:
        """A record from a data frame of polars, which has a column ``time``; otherwise as :meth:`from_pandas`.

        Args:
            mission: The robot that it is of.
            frame: The data frame, a sample per row.
            name: What it is called; prefix of its biases where there are several records.
            options: Those of :meth:`read` but ``topic``.
        """
        return cls._from_columns(mission, {c: frame[c].to_numpy() for c in frame.columns}, name, options)

    @classmethod
    def _from_columns(cls, mission: MissionLike, columns: Mapping[str, Any], name: str, options: Mapping[str, Any]) -> Record:
        import numpy as np

        named: dict[str, Any] = {}
        for column, values in columns.items():
            plain = column.split("[")[0].strip()
            if _is_time(column):
                kind = np.asarray(values).dtype.kind
                if kind == "M":
                    values = values - values[0]
                if kind in "mM":
                    values = values / np.timedelta64(1, "ns") * 1e-9
                    column = "time[s]"
                # A time without a unit is in s.
                named[column.replace(plain, "time", 1)] = values
            elif plain.split(".")[0] in _PREFIXES and "." in plain:
                named[column] = values
        if not named:
            joints = ", ".join(mission.joints)
            raise ValueError(f"no columns of a record: give time, q.<joint>, tau.<joint> and gyro.x, gyro.y, gyro.z; the joints are {joints}")
        read = inspect.signature(cls.read).parameters
        for key in options:
            if key not in read or key in ("path", "mission", "topic", "max_bytes", "separator", "rename", "dates"):
                raise TypeError(f"no option {key!r}; those of Record.read are taken")
        values = {k: list(v) if isinstance(v, (list, tuple, set)) else v for k, v in options.items()}
        core = _ffid.Record.from_columns(core_of(mission), name, named, words(**values))
        warn(core.warnings(), stacklevel=4)
        return cls(core)

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

    @property
    def uniform(self) -> bool:
        """Whether all channels were sampled together on one even clock."""
        return self._core.is_uniform

    def _need(self, channel: str) -> Array:
        x = self._core.channel(channel)
        assert x is not None
        return x

    @property
    def t(self) -> Array:
        """Sample times of the joint motion ``(N,)`` (s)."""
        return self._core.times("q")

    def times(self, channel: Literal["q", "tau", "gyro", "acc", "att"]) -> Array:
        """Sample times of a channel ``(M,)`` (s): those of :attr:`t`, unless the channel was sampled at times of its own.

        Args:
            channel: The channel.
        """
        return self._core.times(channel)

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


_PREFIXES = {"q", "qd", "dq", "qdd", "ddq", "tau", "gyro", "acc", "att"}


def _is_time(column: str) -> bool:
    """Whether a column holds the times of the samples."""
    return column.split("[")[0].strip() in ("time", "t")
