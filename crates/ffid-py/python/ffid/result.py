"""What was identified: parameters with their uncertainty, and what the data say of the model."""

from __future__ import annotations

import html
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

from . import _ffid
from ._options import Array, ArrayLike, Path, Progress, words_of
from .diagnosis import read_all
from .draws import Draws
from .errors import Problem, problems_of, warn, warn_of
from .log import logged
from .mission import Mission
from .motion import Motion, Plan
from .page import Page
from .record import Record
from .table import rows
from .validation import Validation


def _estimate(p: dict[str, Any]) -> dict[str, Any]:
    """A row of parameters in the order in which it is read; what the record cannot tell is none."""
    columns = ["name", "value", "std", "unit", "start", "interval95", "prior_mean", "prior_std", "verdict"]
    return {c: p.get(c) for c in columns + (["truth"] if "truth" in p else [])}


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
        """Reads the folder that :meth:`save` or ``ffid identify`` wrote; it must be complete and untouched.

        Args:
            folder: The folder.
        """
        text, exit_code = _ffid.load_result(folder)
        raw = json.loads(text)
        # Results hold what was put up with as code and text.
        problems = tuple(Problem(w["code"], "warning", "data", w["message"]) for w in raw["warnings"])
        return cls(raw, problems, exit_code, None, FilePath(os.fspath(folder)))

    @property
    def parameters(self) -> Any:
        """The parameters asked for, one per row: name, value, std, unit, start, interval95, prior_mean, prior_std, verdict; truth, where it
        was given. A data frame where pandas is installed, else a :class:`Table`."""
        return rows([_estimate(p) for p in self.raw["parameters"]])

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
        return rows([_estimate(p) for p in self.raw["nuisance"]])

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
        return rows(self.raw.get("budget", []))

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
        modes: list[dict[str, Any]] = self.raw["modes"]
        return modes

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
        """Measured and predicted signals of a fitted record: ``t`` ``(N,)`` (s), ``measured`` and ``predicted`` ``(N, channels)``, ``names``,
        ``units``, and ``sigma`` ``(channels,)``, the standard deviation of a sample. NaN where a channel was not sampled.

        Args:
            record: Which of the records, in the order in which they were fitted.
        """
        if self._core is not None:
            found = self._core.signals(record)
        else:
            labels = [r["label"] for r in self.raw.get("records", [])]
            stem = "residuals" if record == 0 else f"residuals-{labels[record]}" if 0 < record < len(labels) else None
            found = None if stem is None else self._signals_of(self._at(f"{stem}.csv"))
        if found is None:
            raise LookupError(f"no signals of record {record}")
        return found

    def held_out_signals(self) -> dict[str, Any]:
        """Signals of the data that were held out, as :meth:`signals`."""
        if self._core is not None:
            found = self._core.signals(None)
        else:
            file = self._at("held-out.csv")
            found = self._signals_of(file) if file.exists() else None
        if found is None:
            raise LookupError("nothing was held out")
        return found

    def _signals_of(self, file: FilePath) -> dict[str, Any]:
        """Signals from the file that was written of them."""
        import numpy as np

        with file.open(encoding="utf-8") as lines:
            head = lines.readline().rstrip("\n").split(",")
        table = np.genfromtxt(file, delimiter=",", skip_header=1, ndmin=2)
        columns = [h.rsplit("[", 1) for h in head]
        measured = [i for i, (name, _) in enumerate(columns) if name.endswith(".measured")]
        noise = {"tau": self.raw["provenance"]["noise_torque_nm"], "gyr": self.raw["provenance"]["noise_gyro_rad_per_s"]}
        names = [columns[i][0].removesuffix(".measured") for i in measured]
        return {
            "t": table[:, 0],
            "measured": table[:, measured],
            "predicted": table[:, [i + 1 for i in measured]],
            "names": names,
            "units": [columns[i][1].removesuffix("]") for i in measured],
            "sigma": np.array([noise["gyr" if name.startswith("gyro") else "tau"] for name in names]),
        }

    @property
    def draws(self) -> Draws | None:
        """Draws from the posterior, where ``sample`` asked for them."""
        import numpy as np

        how = self.raw.get("sampled") or {}
        attrs = {k: how.get(k) for k in ("state", "sampler", "seed", "warm_up")}
        if self._core is not None:
            d = self._core.draws()
            return None if d is None else Draws(d["names"], d["units"], d["values"], d["lp"], d["divergences"], attrs)
        if not how.get("file"):
            return None
        table = _ffid.read_table(self._at(how["file"]))
        chain, lp = table.pop("chain"), table.pop("lp")
        table.pop("draw")
        chains = int(chain.max()) + 1
        units = {p["name"]: p["unit"] for p in [*how.get("parameters", []), *how.get("beside", [])]}
        values = np.stack([x.reshape(chains, -1) for x in table.values()], axis=2)
        names = list(table)
        return Draws(names, [units.get(n, "") for n in names], values, lp.reshape(chains, -1), how.get("divergences"), attrs)

    def to_arviz(self) -> Any:
        """Draws and data as ArviZ has them: those of :meth:`Draws.to_arviz`. Needs ArviZ, and ``identify(..., sample=400)``."""
        draws = self.draws
        if draws is None:
            why = (self.raw.get("sampled") or {}).get("reason")
            raise LookupError(why or "the posterior was not drawn from; identify with sample=400")
        return draws.to_arviz()

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

    def report(self) -> Page:
        """The report as an HTML page, with its figures; in a notebook it is shown."""
        if self._core is None:
            return Page(self._at("report.html").read_text(encoding="utf-8"))
        return Page(self._core.report())

    def predict(self, trajectory: Motion | Plan | Path | ArrayLike, q: ArrayLike | None = None, *, hold: float = 0.0) -> Record:
        """What the identified robot does on a motion, without noise or bias.

        Args:
            trajectory: A motion, a plan, a file; or times ``(N,)`` (s), with ``q``.
            q: Joint positions at these times ``(N, n)`` (rad or m).
            hold: Seconds to go on after the end of the motion, joints held.
        """
        return self.mission.simulate(trajectory, q, hold=hold, noise_free=True, name="predicted")

    def validate(
        self,
        record: Record | Path,
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
        progress: Progress | None = None,
    ) -> Validation:
        """Judges the model by a record that was not fitted. A model that does not explain it is no exception:
        :attr:`Validation.explained` says it.

        Args:
            record: The record, or its file.
            torque_noise: Standard deviation of one torque sample (N m), in place of that of the identification.
            current_noise: Standard deviation of one sample of a motor current (A), in place of the mission's.
            gyro_noise: Standard deviation of one gyro sample (rad/s), in place of that of the identification.
            no_biases: Take gyro and torque sensors as free of bias.
            initial_state: Estimate base rate and appendages at the first sample; at rest unless given.
            max_iterations: Most linearisations of biases and initial state.
            max_chi2: Largest chi-squared per degree of freedom that counts as explained.
            low_pass: Cutoff of the filter of motion, torques and equations (Hz); that of the identification unless given.
            allow: Errors that are to be warnings, by code.
            strict: Whether warnings are errors.
            progress: Called with ``"validate"``, linearisation and chi-squared per residual.
        """
        mission = self.mission
        (given,) = read_all(record, mission, allow=allow, strict=strict)
        options = words_of(Result.validate, locals(), leave=("progress",))
        verdict = Validation(*_ffid.validate(mission._core, json.dumps(self.raw), given._core, options, logged(progress)))
        known = {str(p) for p in problems_of(given._core.warnings()) + problems_of(mission._core.warnings())}
        warn_of([p for p in verdict.problems if str(p) not in known and p.severity == "warning"])
        return verdict

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
