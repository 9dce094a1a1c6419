"""Missions: a robot with its appendages, sensors, limits and what is to be estimated."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from . import _ffid
from ._options import ArrayLike, Path, words
from .errors import from_json, warn
from .model import Model

if TYPE_CHECKING:
    from .motion import Motion, Plan
    from .record import Record


class Mission:
    """A mission file with its robot, checked."""

    _core: _ffid.Mission
    _keep: object

    def __init__(self, core: _ffid.Mission, keep: object = None) -> None:
        self._core = core
        self._keep = keep

    @classmethod
    def load(cls, path: Path, *, allow: Sequence[str] = (), strict: bool = False) -> Mission:
        """Loads a mission file (``.toml``), or a robot alone (URDF, MJCF, SDF).

        Args:
            path: The file.
            allow: Errors that are to be warnings, by code, such as ``triangle``.
            strict: Whether warnings are errors.

        Raises:
            FfidError: With every problem of the files.
        """
        core = _ffid.Mission.load(path, list(allow), strict)
        warn(core.warnings())
        return cls(core)

    @classmethod
    def from_urdf(
        cls,
        urdf: Path,
        *,
        out: Path | None = None,
        fixed: bool = False,
        stiffness: float | Mapping[str, float] | None = None,
        damping: float | Mapping[str, float] | None = None,
        rate_hz: float | None = None,
        torque_noise: float | None = None,
        gyro_noise: float | None = None,
        tank: tuple[float, float, float, float] | None = None,
        tank_at: tuple[float, float, float] | None = None,
        allow: Sequence[str] = (),
        strict: bool = False,
        force: bool = False,
    ) -> Mission:
        """Begins a mission for a URDF: base, arm and panels are guessed from the tree, as ``ffid init`` does.

        Args:
            urdf: The robot.
            out: The mission file to write; none is kept unless given.
            fixed: Whether the base is bolted to the ground, under gravity.
            stiffness: Of the hinges of panels (N m/rad), of all or by joint.
            damping: Of the hinges of panels (N m s/rad), of all or by joint.
            rate_hz: Sample rate of all sensors (Hz).
            torque_noise: Standard deviation of the torque sensors (N m).
            gyro_noise: Standard deviation of the gyro (rad/s).
            tank: Fuel in the base as a pendulum: mass (kg), length (m), stiffness (N m/rad), damping (N m s/rad).
            tank_at: Where the pendulum hangs, in the frame of the base link (m).
            allow: Errors that are to be warnings, by code.
            strict: Whether warnings are errors.
            force: Whether ``out`` may replace a file.
        """

        def hinges(x: float | Mapping[str, float] | None) -> list[str] | float | None:
            return [f"{joint}={value}" for joint, value in x.items()] if isinstance(x, Mapping) else x

        keep = _TemporaryFolder() if out is None else None
        file = keep.path / "mission.toml" if keep else FilePath(os.fspath(out or ""))
        options = words(
            out=file,
            fixed=fixed,
            stiffness=hinges(stiffness),
            damping=hinges(damping),
            rate_hz=rate_hz,
            torque_noise=torque_noise,
            gyro_noise=gyro_noise,
            tank=None if tank is None else ",".join(str(x) for x in tank),
            tank_at=None if tank_at is None else ",".join(str(x) for x in tank_at),
            allow=list(allow),
            strict=strict,
            force=force,
        )
        exit_code, text, complaint = _ffid.command(["init", os.fspath(urdf), *options, "--json"])
        if exit_code != 0:
            raise _failure(exit_code, text, complaint)
        core = _ffid.Mission.load(file, list(allow), strict)
        warn(core.warnings())
        return cls(core, keep)

    @property
    def file(self) -> FilePath:
        """The file that it was read from."""
        return FilePath(self._core.file)

    def to_toml(self) -> str:
        """The text of the mission file, with the estimates of an identification. It names the robot by a path relative to :attr:`file`, or to
        the folder of :meth:`save`, which copies both."""
        if self._core.is_changed:
            return self._core.files()[0][1].decode("utf-8")
        return self.file.read_text(encoding="utf-8")

    def save(self, folder: Path) -> FilePath:
        """Writes the mission with its robot into a folder, and returns the mission file. Files there are replaced."""
        target = FilePath(os.fspath(folder))
        target.mkdir(parents=True, exist_ok=True)
        first = target
        for i, (name, content) in enumerate(self._core.files()):
            (target / name).write_bytes(content)
            if i == 0:
                first = target / name
        return first

    @property
    def model(self) -> Model:
        """The robot with its appendages, for the dynamics over arrays."""
        return Model(self._core)

    @property
    def joints(self) -> list[str]:
        """Names of the moving joints, in order."""
        return self.model.joints

    @property
    def parameters(self) -> list[dict[str, Any]]:
        """Name, unit, value, bounds and whether it is to be estimated, of every parameter."""
        rows: list[dict[str, Any]] = json.loads(self._core.parameters())
        return rows

    def check(self) -> dict[str, Any]:
        """What the mission says: bodies, joints, appendages, parameters. Problems were raised or warned of when it was loaded."""
        summary: dict[str, Any] = json.loads(self._core.check()[0])
        return summary

    def modes(
        self, *, held: bool = False, free_joints: bool = False, q: Sequence[float] | None = None
    ) -> list[dict[str, Any]]:
        """Natural modes by ascending frequency: ``frequency_hz``, ``damping_ratio`` and shape.

        Args:
            held: Whether the base is held as well: the modes on a test bench.
            free_joints: Whether the joints move freely.
            q: Joint positions (rad or m), those of the mission unless given.
        """
        if held and free_joints:
            raise ValueError("give held or free_joints, not both")
        if q is not None and len(q) != len(self.joints):
            raise ValueError(f"q has {len(q)} positions, {len(self.joints)} needed")
        boundary = "base-held" if held else "joints-free" if free_joints else "joints-held"
        modes: list[dict[str, Any]] = json.loads(self._core.modes(boundary, None if q is None else list(q))[0])["modes"]
        return modes

    def simulate(
        self,
        trajectory: Motion | Plan | Path | ArrayLike,
        q: ArrayLike | None = None,
        *,
        hold: float = 0.0,
        seed: int = 0,
        noise_free: bool = False,
        name: str = "simulated",
    ) -> Record:
        """Simulates a joint motion from rest and returns the record that the mission's sensors would read.

        Args:
            trajectory: A motion, a plan, a file of ``ffid excite`` or ``.csv``; or times (s), with ``q``.
            q: Joint positions at these times ``(N, n)`` (rad or m).
            hold: Seconds to go on after the end of the motion, joints held.
            seed: Seed of the noise.
            noise_free: Whether readings are exact, with joint rates, accelerations and attitude.
            name: What the record is called.
        """
        from .motion import motion_of
        from .record import Record

        if not (hold >= 0.0 and hold < float("inf")):
            raise ValueError(f"hold is {hold} s, limit >= 0 s")
        core = motion_of(self, trajectory, q)
        arrays = self._core.simulate(core, hold, None if noise_free else seed, None)
        known: dict[str, Any] = {k: arrays[k] for k in ("t", "q", "qd", "qdd", "tau", "gyro", "att") if k in arrays}
        return Record.from_arrays(self, **known, name=name)

    def __repr__(self) -> str:
        m = self.model
        return f"Mission({m.name!r}, joints={len(m.joints)}, parameters={len(self.parameters)})"


class _TemporaryFolder:
    """A folder that lasts as long as what refers to it."""

    def __init__(self) -> None:
        self.path = FilePath(tempfile.mkdtemp(prefix="ffid-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def _failure(exit_code: int, text: str, complaint: str) -> Exception:
    """The exception of a command that printed JSON, or wrong usage."""
    try:
        problems = json.loads(text)["problems"]
    except (ValueError, KeyError):
        what = (complaint.splitlines() or ["no output"])[0].removeprefix("error: ")
        problems = [{"code": "Config::Option", "severity": "error", "area": "config", "message": what}]
    return from_json(json.dumps(problems), exit_code)
