"""What Ctrl-C leaves of a computation."""

from __future__ import annotations

from .mission import Mission
from .motion import Plan
from .result import Result


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a computation; what it had is kept. A ``KeyboardInterrupt``: what catches only errors lets it through.

    Attributes:
        result: The identification, where the fit had ended and what came after it (draws from the posterior) was interrupted.
        plan: The best plan so far.
        values: Values of the parameters asked for where the fit was best, by name (SI units). They are no estimates: the fit had not ended,
            and nothing says how far they are from its end. Empty while a fit goes over a thinned record, as it begins.
        chi2_per_residual: Sum of squared residuals over the noise, per residual, at these values.
        linearisations: Linearisations so far.
        mission: The mission with these values in place, from which a fit can go on.
    """

    result: Result | None
    plan: Plan | None
    values: dict[str, float]
    chi2_per_residual: float | None
    linearisations: int
    mission: Mission | None

    def __init__(
        self,
        what: str,
        *,
        result: Result | None = None,
        plan: Plan | None = None,
        values: dict[str, float] | None = None,
        chi2_per_residual: float | None = None,
        linearisations: int = 0,
        mission: Mission | None = None,
    ) -> None:
        super().__init__(what)
        self.result = result
        self.plan = plan
        self.values = values or {}
        self.chi2_per_residual = chi2_per_residual
        self.linearisations = linearisations
        self.mission = mission
