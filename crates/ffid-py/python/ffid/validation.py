"""The judgement of a model by data that were not fitted."""

from __future__ import annotations

import html
import json
from typing import Any

from .errors import Problem, problems_of


class Validation:
    """The judgement of a model by a record that was not fitted.

    Attributes:
        raw: As ``verdict.json`` has it.
        signals: As :meth:`Result.signals`.
        problems: What was put up with, and ``Fit::NotExplained`` where the model does not explain the record.
        exit_code: What ``ffid validate`` would end with: 0, or 16 where the model does not explain the record.
    """

    raw: dict[str, Any]
    signals: dict[str, Any]
    problems: tuple[Problem, ...]
    exit_code: int

    def __init__(self, verdict: str, text: str, signals: dict[str, Any], problems: str, exit_code: int) -> None:
        self.raw = json.loads(verdict)
        self.signals = signals
        self.problems = problems_of(problems)
        self.exit_code = exit_code
        self._text = text

    @property
    def explained(self) -> bool:
        """Whether the model explains the record."""
        return bool(self.raw["explained"])

    @property
    def verdict(self) -> str:
        """What it comes to, in words."""
        return str(self.raw["verdict"])

    @property
    def chi2_per_dof(self) -> float:
        """Sum of squared residuals over the noise, per degree of freedom."""
        return float(self.raw["chi2_per_dof"])

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return f"Validation(explained={self.explained}, chi2_per_dof={self.chi2_per_dof:.3f})"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self._text)}</pre>"
