"""Manoeuvres: planned, and judged before they are flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from . import _ffid
from ._options import ArrayLike, Path, Progress, core_of, words
from .interrupted import Interrupted
from .log import logged
from .mission import Mission
from .motion import Plan, Preflight, Trajectory, motion_of


def plan_excitation(
    mission: Mission,
    *,
    goal: Literal["information", "modal", "quiet", "paper", "condition"] | None = None,
    seed: int | None = None,
    starts: int | None = None,
    cost: Callable[[Plan], float] | None = None,
    candidates: int | None = None,
    allow: Sequence[str] = (),
    strict: bool = False,
    progress: Progress | None = None,
) -> Plan:
    """Plans the manoeuvre of ``[excite]`` within the limits of the mission.

    Args:
        mission: The mission.
        goal: What to plan for, in place of ``excite.goal``.
        seed: Seed, in place of ``excite.seed``.
        starts: Local searches from random plans, in place of ``excite.starts``.
        cost: Called with each of several plans, which are found for the goal with seeds ``seed``, ``seed + 1`` ..: the one of least cost is
            returned. The search itself follows the goal; the cost chooses among what it finds.
        candidates: How many plans the cost chooses from, 4 unless given.
        allow: Errors that are to be warnings, by code.
        strict: Whether warnings are errors.
        progress: Called with stage, iteration and cost of the search.

    Raises:
        FfidError: When the mission is refused, or no plan keeps its limits.
        Interrupted: At Ctrl-C, with the best plan so far.
    """
    if cost is None:
        if candidates is not None:
            raise ValueError("candidates are for a cost that chooses among them; give cost as well")
        return _search(mission, goal, seed, starts, allow, strict, progress)
    number = 4 if candidates is None else int(candidates)
    if number < 1:
        raise ValueError(f"candidates is {number}, limit >= 1")
    first = 0 if seed is None else seed
    best: tuple[float, Plan] | None = None
    for k in range(number):
        try:
            plan = _search(mission, goal, first + k, starts, allow, strict, progress)
        except Interrupted as e:
            if best is not None:
                e.plan = best[1]
            raise
        value = float(cost(plan))
        if value != value:
            raise ValueError(f"the cost of plan {k} is not a number")
        if best is None or value < best[0]:
            best = (value, plan)
    assert best is not None
    return best[1]


def _search(
    mission: Mission,
    goal: str | None,
    seed: int | None,
    starts: int | None,
    allow: Sequence[str],
    strict: bool,
    progress: Progress | None,
) -> Plan:
    options = words(goal=goal, seed=seed, starts=starts, allow=allow, strict=strict)
    found, broken = _ffid.plan_excitation(core_of(mission), options, logged(progress))
    plan = None
    if found is not None:
        trajectory, how, verdict, text, faults = found
        plan = Plan(mission, trajectory, how, Preflight(verdict, text, faults))
    if isinstance(broken, KeyboardInterrupt):
        raise Interrupted("planning was interrupted; plan holds the best so far", plan=plan) from broken
    if broken is not None:
        raise broken
    assert plan is not None
    return plan


def preflight(mission: Mission, trajectory: Trajectory, q: ArrayLike | None = None) -> Preflight:
    """Judges a motion before it is flown: what its record will tell, which limits it keeps.

    Args:
        mission: The mission.
        trajectory: A motion, a plan, a file; or times ``(N,)`` (s), with ``q``.
        q: Joint positions at these times ``(N, n)`` (rad or m).
    """
    return Preflight(*motion_of(mission, trajectory, q).preflight(core_of(mission)))
