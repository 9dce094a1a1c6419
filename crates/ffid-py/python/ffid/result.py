"""Identification: from a mission and records to parameters with their uncertainty."""

from __future__ import annotations

import html
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal, Union

from . import _ffid
from ._options import Array, ArrayLike, Path, Progress, words
from .errors import Problem, problems_of, warn
from .mission import Mission
from .record import Record

if TYPE_CHECKING:
    from .motion import Motion

Records = Union[Record, Path, Sequence[Union[Record, Path]]]
"""A record or a file, or several of one robot."""


def _rows(rows: list[dict[str, Any]]) -> Any:
    """A data frame where pandas is installed, else the rows."""
    try:
        import pandas
    except ImportError:
        return rows
    return pandas.DataFrame(rows)


def _estimate(p: dict[str, Any]) -> dict[str, Any]:
    """A row of parameters in the order in which it is read; what the record cannot tell is none."""
    columns = ("name", "value", "std", "unit", "start", "interval95", "prior_mean", "prior_std", "verdict")
    return {c: p.get(c) for c in columns}


class Result:
    """What was identified.

    Attributes:
        raw: Everything, as ``result.json`` has it.
        problems: What was put up with, and what the result itself finds fault with.
        exit_code: What ``ffid identify`` would end with: 0, 13 (not identifiable), 14 (no solution), 16 (contradicted), 17 (not tested).
    """

    raw: dict[str, Any]
    problems: tuple[Problem, ...]
    exit_code: int

    def __init__(
        self,
        raw: dict[str, Any],
        problems: tuple[Problem, ...],
        exit_code: int,
        core: _ffid.Identification | None,
        folder: FilePath | None,
    ) -> None:
        self.raw = raw
        self.problems = problems
        self.exit_code = exit_code
        self._core = core
        self._folder = folder
        self._keep: object = None

    @classmethod
    def load(cls, folder: Path) -> Result:
        """Reads the folder that :meth:`save` or ``ffid identify`` wrote; it must be complete and untouched."""
        text, exit_code = _ffid.load_result(folder)
        raw = json.loads(text)
        # Results hold what was put up with as code and text.
        problems = tuple(Problem(w["code"], "warning", "data", w["message"]) for w in raw["warnings"])
        return cls(raw, problems, exit_code, None, FilePath(os.fspath(folder)))

    @property
    def parameters(self) -> Any:
        """The parameters asked for, one per row: name, value, std, unit, start, interval95, prior_mean, prior_std, verdict. A data frame where
        pandas is installed, else a list of rows."""
        return _rows([_estimate(p) for p in self.raw["parameters"]])

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters asked for, by name (SI units)."""
        return {p["name"]: p["value"] for p in self.raw["parameters"]}

    @property
    def std(self) -> dict[str, float | None]:
        """Their standard deviations; none where the record cannot tell."""
        return {p["name"]: p.get("std") for p in self.raw["parameters"]}

    @property
    def nuisance(self) -> Any:
        """Biases and initial state, as :attr:`parameters`."""
        return _rows([_estimate(p) for p in self.raw["nuisance"]])

    @property
    def covariance(self) -> Array:
        """Covariance of parameters and nuisance, in the order of :attr:`covariance_names`."""
        import numpy as np

        return np.array(self.raw["covariance"]["rows"], dtype=np.float64)

    @property
    def covariance_names(self) -> list[str]:
        """Names of rows and columns of :attr:`covariance`."""
        return list(self.raw["covariance"]["names"])

    @property
    def budget(self) -> Any:
        """Where the variance of every parameter comes from, where the mission is not sure of something."""
        return _rows(self.raw.get("budget", []))

    @property
    def verdict(self) -> str:
        """What was found, and what was not, in words."""
        return "\n".join(self.raw["verdict"])

    @property
    def explains(self) -> bool | None:
        """Whether the model explains the record; none where that was not tested."""
        evidence = self.raw.get("evidence")
        state = evidence["state"] if evidence else "not_tested"
        return {"explained": True, "contradicted": False}.get(state)

    @property
    def held_out(self) -> dict[str, Any] | None:
        """The judgement of data that were not fitted."""
        return self.raw.get("held_out")

    @property
    def modes(self) -> list[dict[str, Any]]:
        """Modes of the identified model: ``frequency_hz``, ``damping_ratio``, and ``start_hz`` before."""
        rows: list[dict[str, Any]] = self.raw["modes"]
        return rows

    @property
    def chi2_per_dof(self) -> float:
        """Sum of squared residuals over the noise, per degree of freedom."""
        return float(self.raw["chi2_per_dof"])

    @property
    def mission(self) -> Mission:
        """The mission with the estimates in place."""
        if self._core is not None:
            return Mission(self._core.mission(), self._keep)
        return Mission.load(self._at("identified.toml"))

    def signals(self, record: int = 0) -> dict[str, Any]:
        """Measured and predicted signals of a fitted record: ``t`` (s), ``measured`` and ``predicted`` ``(N, channels)``, ``names``,
        ``units``, ``sigma``. Not of results that were loaded: their folder has ``residuals.csv``."""
        found = None if self._core is None else self._core.signals(record)
        if found is None:
            raise LookupError(f"no signals of record {record}")
        return found

    def save(self, folder: Path, *, force: bool = False, png: bool = False) -> None:
        """Writes the folder of ``ffid identify``: report, result, identified mission and URDF, residuals, figures, manifest.

        Args:
            folder: The folder; it must not exist unless ``force``.
            force: Whether an existing folder may be replaced; the old one is kept as ``folder.bak``.
            png: Whether figures are written as PNG beside the SVG.
        """
        if self._core is None:
            shutil.copytree(self._at(""), folder, dirs_exist_ok=force)
            return
        warn(self._core.save(folder, force, png))
        self.raw = json.loads(self._core.json())

    def report(self) -> str:
        """The report as an HTML page, with its figures."""
        if self._core is None:
            return self._at("report.html").read_text(encoding="utf-8")
        return self._core.report()

    def predict(self, trajectory: Any, q: ArrayLike | None = None, *, hold: float = 0.0) -> Record:
        """What the identified robot does on a motion, without noise or bias; arguments are those of :meth:`Mission.simulate`."""
        return self.mission.simulate(trajectory, q, hold=hold, noise_free=True, name="predicted")

    def validate(
        self,
        record: Record | Path,
        *,
        torque_noise: float | None = None,
        gyro_noise: float | None = None,
        no_biases: bool = False,
        initial_state: bool = False,
        max_iterations: int | None = None,
        max_chi2: float | None = None,
        low_pass: float | None = None,
        progress: Progress | None = None,
    ) -> Validation:
        """Judges the model by a record that was not fitted; the keywords are those of :func:`identify`."""
        mission = self.mission
        given = record if isinstance(record, Record) else Record.read(record, mission)
        options = words(
            torque_noise=torque_noise,
            gyro_noise=gyro_noise,
            no_biases=no_biases,
            initial_state=initial_state,
            max_iterations=max_iterations,
            max_chi2=max_chi2,
            low_pass=low_pass,
        )
        return Validation(*_ffid.validate(mission._core, json.dumps(self.raw), given._core, options, progress))

    def _at(self, name: str) -> FilePath:
        if self._folder is None:
            raise LookupError("the result was not loaded from a folder")
        return self._folder / name

    def __str__(self) -> str:
        if self._core is not None:
            return self._core.text()
        return self._at("report.txt").read_text(encoding="utf-8")

    def __repr__(self) -> str:
        return f"Result({self.raw['robot']!r}, {len(self.raw['parameters'])} parameters, chi2_per_dof={self.chi2_per_dof:.3f})"

    def _repr_html_(self) -> str:
        def number(x: float | None) -> str:
            return "" if x is None else f"{x:.5g}"

        head = "".join(f"<th>{h}</th>" for h in ("parameter", "value", "std", "unit", "start", "verdict"))
        rows = "".join(
            f"<tr><td>{html.escape(p['name'])}</td><td>{number(p['value'])}</td><td>{number(p.get('std'))}</td>"
            f"<td>{html.escape(p['unit'])}</td><td>{number(p['start'])}</td><td>{html.escape(p['verdict'].replace('_', ' '))}</td></tr>"
            for p in self.raw["parameters"]
        )
        words = "<br>".join(html.escape(line) for line in self.raw["verdict"])
        return f"<p>{words}</p><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


class Validation:
    """The judgement of a model by a record that was not fitted.

    Attributes:
        raw: As ``verdict.json`` has it.
        signals: As :meth:`Result.signals`.
    """

    raw: dict[str, Any]
    signals: dict[str, Any]

    def __init__(self, verdict: str, text: str, signals: dict[str, Any]) -> None:
        self.raw = json.loads(verdict)
        self.signals = signals
        self._text = text

    @property
    def explained(self) -> bool:
        """Whether the model explains the record."""
        return bool(self.raw["explained"])

    @property
    def chi2_per_dof(self) -> float:
        """Sum of squared residuals over the noise, per degree of freedom."""
        return float(self.raw["chi2_per_dof"])

    def __str__(self) -> str:
        return self._text


def identify(
    mission: Mission,
    records: Records,
    *,
    held_out: float | Record | Path | None = None,
    method: Literal["auto", "rda", "output-error", "ground"] = "auto",
    prior: float | None = None,
    no_prior: bool = False,
    prior_from: Path | None = None,
    consider: bool = False,
    sample: int | None = None,
    ties: Path | None = None,
    loss: Literal["squares", "huber", "student"] = "squares",
    reduce: bool = False,
    profile: Sequence[str] = (),
    starts: int = 1,
    compare: Sequence[Literal["rigid", "flexible", "slosh", "both"]] = (),
    adopt: Sequence[str] = (),
    clocks: Literal["correct", "require", "trust"] = "correct",
    external_torque: bool = False,
    modes: bool = False,
    no_start_offset: bool = False,
    seed: int = 0,
    torque_noise: float | None = None,
    gyro_noise: float | None = None,
    no_biases: bool = False,
    initial_state: bool = False,
    max_iterations: int | None = None,
    max_chi2: float | None = None,
    low_pass: float | None = None,
    allow: Sequence[str] = (),
    strict: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Estimates the parameters of ``[estimate]`` from one or several records. The numbers are those of ``ffid identify``.

    Other Python threads run meanwhile; Ctrl-C ends the fit.

    Args:
        mission: The mission.
        records: A record or a file, or several of one robot: parameters are shared, biases and initial state are those of each.
        held_out: Data that judge the model and are not fitted: a fraction (the end of the last record) or another record.
        method: How records are predicted.
        prior: Relative standard deviation of a prior on every parameter, in place of ``estimate.prior_relative_std``.
        no_prior: The data alone, whatever the mission says.
        prior_from: Folder of an earlier result to go on from: its records are fitted as well.
        consider: Hold what the mission is not sure of, and widen the deviations by it, in place of estimating it.
        sample: Draws of each chain from the posterior, after the fit.
        ties: File of ``[[tie]]`` tables: parameters that are functions of fewer unknowns.
        loss: What a residual costs: squares, or less for samples that are far off.
        reduce: Where the record is silent, estimate what it can tell and hold the rest.
        profile: Parameters (names, ``*`` for any) whose likelihood is profiled: intervals that assume no parabola.
        starts: Fit from this many starts and say whether they agree.
        compare: Models to compare; the last 30 % judge unless ``held_out`` does.
        adopt: Errors that are estimated beside the parameters, such as ``gyro-misalignment``.
        clocks: What becomes of clocks of torques and gyro that disagree with that of the encoders.
        external_torque: External torques acted: do not refuse the record for its momentum.
        modes: The modes of the free decay must be told.
        no_start_offset: Leave out ``estimate.start_offset``, which is for studies.
        seed: Seed of other starts.
        torque_noise: Standard deviation of one torque sample (N m), in place of the mission's.
        gyro_noise: Standard deviation of one gyro sample (rad/s), in place of the mission's.
        no_biases: Take gyro and torque sensors as free of bias.
        initial_state: Estimate base rate and appendages at the first sample; at rest unless given.
        max_iterations: Most linearisations.
        max_chi2: Largest chi-squared per degree of freedom that counts as explained.
        low_pass: Cutoff of the filter of motion, torques and equations (Hz), for arms on the ground.
        allow: Errors that are to be warnings, by code.
        strict: Whether warnings are errors.
        progress: Called with ``"fit"``, linearisation and chi-squared per residual.

    Raises:
        FfidError: When mission or records are refused, or the fit fails. A result that nothing can tell, or that the record contradicts,
            is returned, with :attr:`Result.problems` and a warning for each.
    """

    def read(x: Record | Path) -> Record:
        if isinstance(x, Record):
            return x
        allowed = list(allow)
        return Record.read(x, mission, allow=allowed, strict=strict)

    several = [records] if isinstance(records, (Record, str, os.PathLike)) else list(records)
    if not several:
        raise ValueError("no records; give one or more")
    given = [read(r) for r in several]
    held = None if held_out is None or isinstance(held_out, (int, float)) else read(held_out)
    options = words(
        held_out=held_out if held is None else None,
        method=method,
        prior=prior,
        no_prior=no_prior,
        prior_from=prior_from,
        consider=consider,
        sample=sample,
        ties=ties,
        loss=loss,
        reduce=reduce,
        profile=list(profile),
        starts=starts,
        compare=list(compare),
        adopt=list(adopt),
        clocks=clocks,
        external_torque=external_torque,
        modes=modes,
        no_start_offset=no_start_offset,
        seed=seed,
        torque_noise=torque_noise,
        gyro_noise=gyro_noise,
        no_biases=no_biases,
        initial_state=initial_state,
        max_iterations=max_iterations,
        max_chi2=max_chi2,
        low_pass=low_pass,
        allow=list(allow),
        strict=strict,
    )
    cores = [r._core for r in given]
    core = _ffid.identify(mission._core, cores, None if held is None else held._core, options, progress)
    text = core.problems()
    problems = problems_of(text)
    # Those of mission and records were warned of when they were read.
    known = {str(p) for r in given + ([held] if held else []) for p in problems_of(r._core.warnings())}
    known |= {str(p) for p in problems_of(mission._core.warnings())}
    warn(json.dumps([raw for raw, p in zip(json.loads(text), problems) if str(p) not in known]))
    result = Result(json.loads(core.json()), problems, core.exit, core, None)
    # Saving reads the mission file, which must last as long as the result.
    result._keep = mission._keep
    return result
