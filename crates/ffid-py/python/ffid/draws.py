"""Draws from the posterior: as arrays, for ArviZ, and under another prior."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

from ._options import Array
from .errors import FfidWarning, Problem
from .table import rows


class Draws:
    """Draws from the posterior of an identification (``identify(..., sample=400)``).

    Attributes:
        names: Names of the unknowns: the parameters asked for, then those beside them.
        units: Their SI units; empty where a file does not say.
        values: ``(chains, draws, len(names))``.
        log_density: Logarithm of the density over the coordinates that are drawn in, but for a constant ``(chains, draws)``.
        divergences: Trajectories that met the edge of what is physical, and draws without a solution; none where that is not known.
    """

    names: list[str]
    units: list[str]
    values: Array
    log_density: Array
    divergences: int | None

    def __init__(
        self, names: list[str], units: list[str], values: Array, log_density: Array, divergences: int | None, attrs: Mapping[str, Any]
    ) -> None:
        self.names = names
        self.units = units
        self.values = values
        self.log_density = log_density
        self.divergences = divergences
        self._attrs = dict(attrs)

    def __getitem__(self, name: str) -> Array:
        """Draws of one unknown, ``(chains, draws)``."""
        if name not in self.names:
            raise KeyError(f"no unknown {name!r}; names lists them")
        return self.values[:, :, self.names.index(name)]

    def __len__(self) -> int:
        return int(self.values.shape[0] * self.values.shape[1])

    def __repr__(self) -> str:
        chains, draws, n = self.values.shape
        return f"Draws({chains} chains of {draws}, {n} unknowns)"

    def to_arviz(self) -> Any:
        """As ArviZ has it: groups ``posterior`` (a variable for each unknown) and ``sample_stats`` (``lp``). Needs ArviZ: an ``InferenceData``
        of ArviZ before 1.0, else a ``DataTree``."""
        groups: dict[str, Any] = {
            "posterior": {name: self[name] for name in self.names},
            "sample_stats": {"lp": self.log_density},
        }
        try:
            import arviz
        except ImportError:
            try:
                from arviz_base import from_dict
            except ImportError as e:
                raise ImportError("ArviZ is needed: pip install arviz") from e
            return self._described(from_dict(groups))
        old = arviz.__version__.startswith("0.")
        return self._described(arviz.from_dict(**groups) if old else arviz.from_dict(groups))

    def _described(self, data: Any) -> Any:
        """With units and how it was drawn."""
        posterior = data["posterior"]
        for name, unit in zip(self.names, self.units):
            posterior[name].attrs["units"] = unit
        posterior.attrs.update({k: v for k, v in self._attrs.items() if isinstance(v, (str, int, float))})
        return data

    def reweight(self, log_density: Callable[[dict[str, float]], float]) -> WeightedDraws:
        """The draws under a prior density beside those of the fit, by Pareto smoothed importance sampling (A. Vehtari, D. Simpson, A. Gelman,
        Y. Yao, J. Gabry, J. Machine Learning Research 25, 2024). The density is called once for each draw; what it excludes has ``-inf``.

        Args:
            log_density: Called with the values of all unknowns by name (SI units); returns the logarithm of the density, but for a constant.
        """
        import numpy as np

        flat = self.values.reshape(-1, len(self.names))
        added = np.empty(len(flat))
        for i, row in enumerate(flat.tolist()):
            added[i] = float(log_density(dict(zip(self.names, row))))
            if np.isnan(added[i]) or added[i] == np.inf:
                raise ValueError(f"the density is {added[i]} at draw {i}; it must be a number, or -inf where it excludes values")
        if not np.isfinite(added).any():
            raise ValueError("the density excludes all draws: it says that this record is of another robot, or its units are not SI")
        weights, k = pareto_smoothed(added)
        return WeightedDraws(self, weights, k)


class WeightedDraws:
    """Draws from the posterior under another prior.

    Attributes:
        draws: The draws.
        weights: Their weights ``(len(draws),)``, of sum 1; rows of ``draws.values`` chain by chain.
        pareto_k: Shape of the tail of the weights; none where all weigh alike.
        effective: Draws of equal weight that tell as much, ``1 / sum(weights^2)``.
    """

    draws: Draws
    weights: Array
    pareto_k: float | None
    effective: float

    def __init__(self, draws: Draws, weights: Array, pareto_k: float | None) -> None:
        import numpy as np

        self.draws = draws
        self.weights = weights
        self.pareto_k = pareto_k
        self.effective = float(1.0 / np.sum(weights**2))
        if not self.reliable:
            k = "unknown" if pareto_k is None else f"{pareto_k:.2f}"
            what = f"tail of the weights {k}, limit {self._limit:.2f}; {self.effective:.0f} effective draws, limit 400"
            step = "draw more, or give this prior to the fit ([estimate] of the mission) where it is near to Gaussian"
            p = Problem("Fit::Reweighted", "warning", "data", what, object="log_density", next_step=step)
            warnings.warn(FfidWarning(p), stacklevel=3)

    @property
    def _limit(self) -> float:
        import math

        return min(1.0 - 1.0 / math.log10(max(len(self.weights), 11)), 0.7)

    @property
    def reliable(self) -> bool:
        """Whether the draws stand for the posterior under this prior: the tail of the weights is below ``min(1 - 1 / log10(S), 0.7)`` for S
        draws, and 400 draws of equal weight tell no more."""
        return (self.pareto_k is None or self.pareto_k < self._limit) and self.effective >= 400.0

    @property
    def parameters(self) -> Any:
        """Mean, std, median and the interval between the quantiles of 2.5 and 97.5 %, by name (SI units); the interval is none unless
        :attr:`reliable`. A data frame where pandas is installed, else a :class:`Table`."""
        import numpy as np

        flat = self.draws.values.reshape(-1, len(self.draws.names))
        out = []
        for k, name in enumerate(self.draws.names):
            x = flat[:, k]
            mean = float(self.weights @ x)
            order = np.argsort(x)
            share = np.cumsum(self.weights[order])
            at = np.minimum(np.searchsorted(share, (0.025, 0.5, 0.975)), len(x) - 1)
            low, median, high = x[order][at].tolist()
            std = float(np.sqrt(self.weights @ (x - mean) ** 2))
            interval = [low, high] if self.reliable else None
            out.append({"name": name, "mean": mean, "std": std, "median": median, "interval95": interval, "unit": self.draws.units[k]})
        return rows(out)

    def __repr__(self) -> str:
        return f"WeightedDraws({len(self.weights)} draws, {self.effective:.0f} effective, reliable={self.reliable})"


def pareto_smoothed(log_ratios: Array) -> tuple[Array, float | None]:
    """Normalised importance weights whose largest are those of a generalised Pareto distribution, and its shape; none where too few weigh
    more than the others to tell. ``log_ratios`` is ``(S,)``."""
    import numpy as np

    weights = np.exp(log_ratios - log_ratios.max())
    count = len(weights)
    tail = int(min(0.2 * count, 3.0 * np.sqrt(count)))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]] if 0 < tail < count else np.inf
    beyond = order[count - tail :] if tail > 4 else order[:0]
    excess = weights[beyond] - cut
    k = None
    if len(beyond) > 4 and excess[-1] > 0.0 and np.isfinite(cut) and (excess > 0.0).sum() > 4:
        k, scale = _generalised_pareto(excess[excess > 0.0])
        at = (np.arange(len(beyond)) + 0.5) / len(beyond)
        smooth = -scale * np.log1p(-at) if abs(k) < 1e-12 else scale / k * np.expm1(-k * np.log1p(-at))
        # The quantiles of the fitted tail, none above the largest weight.
        weights[beyond] = np.minimum(cut + smooth, 1.0)
    return weights / weights.sum(), None if k is None else float(k)


def _generalised_pareto(excess: Array) -> tuple[float, float]:
    """Shape and scale of a generalised Pareto distribution (J. Zhang, M. Stephens, Technometrics 51, 2009), the shape drawn to 1/2 as ten
    observations would. ``excess`` is ascending and above zero."""
    import numpy as np

    n = len(excess)
    grid = 30 + int(np.sqrt(n))
    quarter = excess[int(n / 4 + 0.5) - 1]
    b = (1.0 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3.0 * quarter) + 1.0 / excess[-1]
    shapes = np.log1p(-b[:, None] * excess).mean(axis=1)
    likelihood = n * (np.log(-b / shapes) - shapes - 1.0)
    share = np.exp(likelihood - likelihood.max())
    best = float((b * share).sum() / share.sum())
    k = float(np.log1p(-best * excess).mean())
    scale = -k / best
    return (n * k + 10 * 0.5) / (n + 10), scale
