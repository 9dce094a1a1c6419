"""Identification: from a mission and records to parameters with their uncertainty."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Union

from . import _ffid
from ._options import Path, Progress, words_of
from .diagnosis import Records, read_all
from .errors import problems_of, warn_of
from .interrupted import Interrupted
from .log import LOG, logged
from .mission import Mission, TemporaryFolder
from .record import Record
from .result import Result

Uncertain = Union[Literal["estimate", "consider", "exact"], Sequence[Mapping[str, Any]]]
"""What becomes of what the mission is not sure of, or tables in place of the mission's."""

# Keywords that are objects in place of options.
_OBJECTS = ("uncertain", "without", "progress")


def identify(
    mission: Mission,
    records: Records,
    *,
    held_out: float | Record | Path | None = None,
    truth: Path | Mission | None = None,
    method: Literal["auto", "rda", "output-error", "ground"] = "auto",
    prior: float | None = None,
    no_prior: bool = False,
    prior_from: Path | None = None,
    without: Mapping[str, Records] | None = None,
    uncertain: Uncertain | None = None,
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
) -> Result:
    """Estimates the parameters of ``[estimate]`` from one or several records. The numbers are those of ``ffid identify``.

    Other Python threads run meanwhile; nothing is printed.

    Args:
        mission: The mission.
        records: A record or a file, or several of one robot: parameters are shared, biases and initial state are those of each.
        held_out: Data that judge the model and are not fitted: a fraction (the end of the last record) or another record.
        truth: Mission that simulated records were made with: ``parameters``, report and replay show its values beside the estimates. They
            are not used.
        method: How records are predicted.
        prior: Relative standard deviation of a prior on every parameter, in place of ``estimate.prior_relative_std``.
        no_prior: The data alone, whatever the mission says.
        prior_from: Folder of an earlier result to go on from: its records are fitted as well.
        without: Payloads of an arm on the ground with the records, of those that are given, in which they were not mounted, such as
            ``{"tool": empty}``.
        uncertain: What becomes of what the mission is not sure of (``[[uncertain]]``, deviations in ``[sensors]``): ``"estimate"`` it beside
            the parameters, as the mission says; ``"consider"``, as ``consider``; take all as ``"exact"``; or tables in place of the mission's,
            as :meth:`Mission.with_uncertain` takes them.
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
        current_noise: Standard deviation of one sample of a motor current (A), in place of the mission's.
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
        Interrupted: At Ctrl-C, with what the fit had. An exception in ``progress`` ends the fit and is raised as it is.
    """

    if uncertain is not None:
        if isinstance(uncertain, str):
            if uncertain not in ("estimate", "consider", "exact"):
                raise ValueError(f"uncertain is {uncertain!r}; give estimate, consider, exact or a list of tables")
            consider = consider or uncertain == "consider"
        if uncertain == "exact" or not isinstance(uncertain, str):
            mission = mission.with_uncertain(() if isinstance(uncertain, str) else uncertain)
    given = read_all(records, mission, allow=allow, strict=strict)
    held = None
    if held_out is not None and not isinstance(held_out, (int, float)):
        (held,) = read_all(held_out, mission, allow=allow, strict=strict)
    # The folder of a mission with changed values lasts until the fit has ended.
    truth_folder = TemporaryFolder() if isinstance(truth, Mission) and truth._core.is_changed else None
    if isinstance(truth, Mission):
        truth = truth.save(truth_folder.path) if truth_folder else truth.file
    options = words_of(identify, {**locals(), "held_out": held_out if held is None else None}, leave=_OBJECTS)
    LOG.info("identify: %s, %s", mission.file, ", ".join(r.name for r in given))
    cores = [r._core for r in given]
    absent = _absent(without or {}, records, given)
    core, kept, broken = _ffid.identify(mission._core, cores, None if held is None else held._core, absent, options, logged(progress))
    if broken is not None and not isinstance(broken, KeyboardInterrupt):
        raise broken
    if core is None:
        if kept is None:
            raise Interrupted("the fit was interrupted before it had looked at all data; nothing is kept") from broken
        values, chi2, count = dict(kept[0]), kept[1], kept[2]
        what = f"the fit was interrupted after {count} linearisations, at chi-squared {chi2:.6g} per residual; values and mission hold its best point"
        at = mission.with_values(values)
        raise Interrupted(what, values=values, chi2_per_residual=chi2, linearisations=count, mission=at) from broken
    problems = problems_of(core.problems())
    result = Result(json.loads(core.json()), problems, core.exit, core, None)
    # Saving reads the mission file, which must last as long as the result.
    result._keep = mission._keep
    if broken is not None:
        what = "interrupted after the fit; result holds it"
        raise Interrupted(what, result=result, values=result.values, mission=result.mission) from broken
    # Those of mission and records were warned of when they were read.
    known = {str(p) for r in given + ([held] if held else []) for p in problems_of(r._core.warnings())}
    known |= {str(p) for p in problems_of(mission._core.warnings())}
    warn_of([p for p in problems if p.severity == "warning" and str(p) not in known])
    LOG.info("identify: exit code %d; %s", result.exit_code, result.verdict)
    return result


def _absent(without: Mapping[str, Records], records: Records, given: Sequence[Record]) -> list[tuple[str, int]]:
    """Payloads with the places of the records in which they were not mounted."""
    one = (Record, str, os.PathLike)
    several = [records] if isinstance(records, one) else list(records)
    found: list[tuple[str, int]] = []
    for payload, where in without.items():
        for record in [where] if isinstance(where, one) else where:
            is_meant = [
                r is record if isinstance(record, Record) else not isinstance(r, Record) and os.fspath(r) == os.fspath(record)
                for r in several
            ]
            if not any(is_meant):
                raise ValueError(f"without: the record of {payload!r} without it, {record!r}, is none of those that are given")
            found.append((payload, is_meant.index(True)))
    return found
