"""Missions: a robot with its appendages, sensors, limits and what is to be estimated."""

from __future__ import annotations

import difflib
import json
import os
import re
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

from . import _ffid
from ._options import ArrayLike, Path, several, words
from .command import run, run_command
from .errors import warn, warn_of
from .model import Model
from .motion import Motion, Plan, motion_of
from .page import Page
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
        core = _ffid.Mission.load(path, several(allow), strict)
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

        keep = TemporaryFolder() if out is None else None
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
            allow=several(allow),
            strict=strict,
            force=force,
        )
        _, problems = run("init", urdf, *options)
        core = _ffid.Mission.load(file, several(allow), strict)
        known = warn(core.warnings())
        warn_of([p for p in problems if p.severity == "warning" and p.message not in {k.message for k in known}])
        return cls(core, keep)

    @classmethod
    def from_toml(cls, text: str, *, folder: Path = ".", allow: Sequence[str] = (), strict: bool = False) -> Mission:
        """Reads a mission from a text, such as :meth:`to_toml` gives, with changes.

        Args:
            text: The mission.
            folder: The folder that its paths (``robot.urdf``, keys that end with ``_file``) are relative to.
            allow: Errors that are to be warnings, by code.
            strict: Whether warnings are errors.
        """
        base = FilePath(os.fspath(folder)).resolve()

        def absolute(found: re.Match[str]) -> str:
            # In a literal string of TOML nothing is escaped.
            return f"{found.group(1)}'{(base / found.group(2)).resolve()}'"

        # Problems name lines: none is added or taken.
        moved = re.sub(r"""(\b(?:urdf|\w+_file)\s*=\s*)["']([^"'\n]*)["']""", absolute, text)
        keep = TemporaryFolder()
        file = keep.path / "mission.toml"
        file.write_text(moved, encoding="utf-8")
        core = _ffid.Mission.load(file, several(allow), strict)
        warn(core.warnings())
        return cls(core, keep)

    def with_values(self, values: Mapping[str, float]) -> Mission:
        """The mission with other values of parameters.

        Args:
            values: Values by name (SI units).
        """
        names = [p["name"] for p in self.parameters]
        pairs = []
        for name, value in values.items():
            if name not in names:
                near = difflib.get_close_matches(name, names, 1)
                raise KeyError(f"no parameter {name!r}{f'; is {near[0]!r} meant?' if near else ''}")
            pairs.append((names.index(name), float(value)))
        return Mission(self._core.with_values(pairs), self._keep)

    def with_uncertain(self, tables: Sequence[Mapping[str, Any]]) -> Mission:
        """The mission with other statements of what is not known exactly: its ``[[uncertain]]`` tables and the deviations of gains,
        scales, alignment and zeros in ``[sensors]`` are replaced.

        Args:
            tables: Tables as in the mission file, such as ``{"bodies": ["l*"], "mass_relative_std": 0.02}``, ``{"parameters":
                ["tank.length"], "relative_std": 0.1}`` or ``{"mounts": ["wing"], "position_std_m": 0.003}``; keys of sensors in a table with
                ``sensor``, such as ``{"sensor": "torque", "gain_relative_std": 0.01}``. None at all: everything is taken as exact.
        """
        text = self.to_toml()
        keys = "|".join(_SENSOR_ERRORS)
        text = re.sub(rf"(?m)^\s*(?:{keys})\s*=.*\n?", "", text)
        # In inline tables: behind another key, or before one, or alone.
        text = re.sub(rf",\s*(?:{keys})\s*=\s*[^,}}\n]+?(?=\s*[,}}])", "", text)
        text = re.sub(rf"(?<=\{{)\s*(?:{keys})\s*=\s*[^,}}\n]+,?", " ", text)
        # From the header of such a table to that of the next.
        text = re.sub(r"(?ms)^\s*\[\[uncertain\]\].*?(?=^\s*\[|\Z)", "", text)
        for table in tables:
            table = dict(table)
            sensor = table.pop("sensor", None)
            body = "".join(f"{key} = {_toml(value)}\n" for key, value in table.items())
            if sensor is None:
                text += f"\n[[uncertain]]\n{body}"
                continue
            wrong = [k for k in table if k not in _SENSOR_ERRORS]
            if wrong:
                raise ValueError(f"{wrong[0]!r} is no error of a sensor; they are {', '.join(_SENSOR_ERRORS)}")
            text = _with_sensor_keys(text, str(sensor), body)
        if not self._core.is_changed:
            made = Mission.from_toml(text, folder=self.file.parent, allow=self._core.allow)
            # Its robot may stand in a folder that lasts as long as this mission.
            made._keep = (made._keep, self._keep)
            return made
        # Beside the robot with its values.
        keep = TemporaryFolder()
        file = self.save(keep.path)
        file.write_text(text, encoding="utf-8")
        core = _ffid.Mission.load(file, self._core.allow, False)
        warn(core.warnings())
        return Mission(core, keep)

    def show(
        self, trajectory: Motion | Plan | Path | None = None, *, hold: float = 0.0, beside: Path | Mission | None = None
    ) -> Page:
        """The robot in 3-D with its modes, as a page that needs no network; in a notebook it is shown.

        Args:
            trajectory: A motion that it plays.
            hold: Seconds to go on after the end of the motion.
            beside: Another mission of the same robot, drawn beside it.
        """
        with tempfile.TemporaryDirectory(prefix="ffid-") as name:
            folder = FilePath(name)

            def file_of(mission: Mission, where: str) -> FilePath:
                return mission.save(folder / where) if mission._core.is_changed else mission.file

            options: dict[str, Any] = {"out": folder / "page.html"}
            if isinstance(trajectory, Plan):
                trajectory.save(folder / "trajectory.json")
                options["trajectory"] = folder / "trajectory.json"
            elif isinstance(trajectory, Motion):
                options["trajectory"] = folder / "trajectory.csv"
                options["trajectory"].write_text(trajectory._csv(), encoding="utf-8")
            elif trajectory is not None:
                options["trajectory"] = trajectory
            if hold:
                options["hold"] = hold
            if beside is not None:
                options["beside"] = file_of(beside, "beside") if isinstance(beside, Mission) else beside
            run_command("show", file_of(self, "own"), **options)
            return Page(options["out"].read_text(encoding="utf-8"))

    def selfcheck(self) -> dict[str, Any]:
        """Holds the simulation of this robot to the laws of mechanics: momentum, energy, dissipation, order of the integrator."""
        with tempfile.TemporaryDirectory(prefix="ffid-") as name:
            file = self.save(name) if self._core.is_changed else self.file
            return run_command("selfcheck", file)

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
        """Writes the mission with its robot into a folder, and returns the mission file. Files there are replaced.

        Args:
            folder: The folder, which is made where it is not.
        """
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
        if not (hold >= 0.0 and hold < float("inf")):
            raise ValueError(f"hold is {hold} s, limit >= 0 s")
        core = motion_of(self, trajectory, q)
        samples = (core.duration + hold) * (self.model._about["rate_hz"] or 0.0)
        if samples > _MOST_SAMPLES:
            raise ValueError(f"{samples:.3g} samples, limit {_MOST_SAMPLES:g}; simulate a shorter motion, or a shorter hold ({hold:g} s)")
        arrays = self._core.simulate(core, hold, None if noise_free else seed, None)
        known: dict[str, Any] = {k: arrays[k] for k in ("t", "q", "qd", "qdd", "tau", "gyro", "att") if k in arrays}
        return Record.from_arrays(self, **known, name=name)

    def __repr__(self) -> str:
        m = self.model
        return f"Mission({m.name!r}, joints={len(m.joints)}, parameters={len(self.parameters)})"


class TemporaryFolder:
    """A folder that lasts as long as what refers to it."""

    def __init__(self) -> None:
        self.path = FilePath(tempfile.mkdtemp(prefix="ffid-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


# Most samples of a simulation.
_MOST_SAMPLES = 2e7
# Keys of [sensors.*] that say how well a sensor is known.
_SENSOR_ERRORS = ("gain_relative_std", "gain_common_relative_std", "scale_relative_std", "misalignment_std_rad", "offset_std_rad")


def _with_sensor_keys(text: str, sensor: str, body: str) -> str:
    """The text of a mission with more keys of a sensor, whose table is a section, an inline table of ``[sensors]``, or not there."""
    head = re.search(rf"(?m)^\s*\[sensors\.{re.escape(sensor)}\].*\n", text)
    if head:
        return text[: head.end()] + body + text[head.end() :]
    section = re.search(r"(?ms)^\s*\[sensors\].*?(?=^\s*\[|\Z)", text)
    inline = section and re.search(rf"(?m)^(\s*{re.escape(sensor)}\s*=\s*\{{)(\s*\}}?)", section.group())
    if section and inline:
        at = section.start() + inline.end(1)
        keys = ", ".join(body.splitlines())
        return f"{text[:at]} {keys}{'' if '}' in inline.group(2) else ','}{text[at:]}"
    return f"{text}\n[sensors.{sensor}]\n{body}"


def _toml(value: Any) -> str:
    """A value in TOML; strings and numbers of JSON are the same there."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(v) for v in value)}]"
    return json.dumps(value)
