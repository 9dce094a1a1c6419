"""Dynamics over arrays: one state per row, in vector lanes and on threads."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from . import _ffid
from ._options import Array, ArrayLike, Path
from .errors import warn


class Derivatives(NamedTuple):
    """Derivatives of inverse dynamics, each ``(N, nv, nv)``; columns of ``dq`` are small motions in the order of the velocity."""

    dq: Array
    dv: Array
    da: Array


class Hybrid(NamedTuple):
    """Accelerations ``(N, nv)`` and joint torques ``(N, n)`` (N m or N)."""

    a: Array
    tau: Array


class Momentum(NamedTuple):
    """Momentum and energy, in world axes.

    ``linear`` (kg m/s), ``angular`` about the world origin and ``angular_com`` about the centre of mass (kg m^2/s), ``com`` (m), all
    ``(N, 3)``; ``kinetic`` and ``potential`` energy (J), ``(N,)``.
    """

    linear: Array
    angular: Array
    angular_com: Array
    com: Array
    kinetic: Array
    potential: Array


class BaseParameters(NamedTuple):
    """Combinations of parameters that motions tell: ``tau = Y[:, :, kept] @ (matrix @ parameter_values)`` for rigid bodies.

    ``kept`` are the indices of the parameters whose columns are kept ``(r,)``, ``matrix`` has the base parameters as functions of all
    parameters ``(r, n_params)`` (1 for the one that is kept, SI units), ``condition`` is the condition number of the kept columns, scaled by
    the sizes of their parameters, and ``expressions`` has each base parameter in words ``(r,)``.
    """

    kept: list[int]
    matrix: Array
    condition: float
    expressions: list[str]


class Model:
    """A robot with its appendages, whose dynamics are computed over arrays.

    A row of positions ``q`` is ``[base position 3 (m) | base attitude w x y z | joints n (rad or m) | passive coordinates m]``, without
    the first seven numbers for a fixed base: ``nq`` numbers. A row of velocities ``v`` is ``[base twist 6, base axes, linear first (m/s,
    rad/s) | joint rates n | passive rates m]``: ``nv`` numbers, as accelerations ``a`` and generalised forces ``tau`` (N, N m) have.
    Every method takes ``parameters``, an array or a mapping of names to values, in place of those of the mission; ``out``, an array for
    the results; and ``threads`` (0: as many as the machine has).
    """

    _core: _ffid.Mission
    _about: dict[str, Any]

    def __init__(self, core: _ffid.Mission) -> None:
        self._core = core
        self._about = json.loads(core.about())

    @classmethod
    def from_urdf(
        cls,
        path: Path,
        *,
        base: Literal["floating", "fixed"] = "floating",
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Model:
        """Reads a robot alone: URDF, MJCF or SDF.

        Args:
            path: The file.
            base: Whether the base floats or is bolted to the ground.
            gravity: In world axes ``(3,)`` (m/s^2).
        """
        if base not in ("floating", "fixed"):
            raise ValueError(f"base is {base!r}, floating or fixed needed")
        core = _ffid.Mission.robot(path, base == "fixed", gravity)
        warn(core.warnings())
        return cls(core)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return str(self._about["name"])

    @property
    def joints(self) -> list[str]:
        """Names of the moving joints, in order."""
        return list(self._about["joints"])

    @property
    def frames(self) -> list[str]:
        """Names of the frames."""
        return list(self._about["frames"])

    @property
    def dofs(self) -> list[str]:
        """Names of the generalised velocities, in order."""
        return list(self._about["dofs"])

    @property
    def nq(self) -> int:
        """Numbers in a row of positions."""
        return int(self._about["nq"])

    @property
    def nv(self) -> int:
        """Numbers in a row of velocities."""
        return int(self._about["nv"])

    @property
    def floating(self) -> bool:
        """Whether the base floats."""
        return bool(self._about["floating"])

    @property
    def parameter_names(self) -> list[str]:
        """Names of the parameters, in the order of the columns of :meth:`regressor`."""
        return [p["name"] for p in json.loads(self._core.parameters())]

    @property
    def parameter_values(self) -> Array:
        """Values of the parameters (SI units), ``(n_params,)``."""
        import numpy as np

        return np.array([p["value"] for p in json.loads(self._core.parameters())])

    def neutral(self, rows: int = 1) -> Array:
        """Positions ``(rows, nq)`` at the nominal pose: base at the origin, joints at the mission's pose, appendages at rest.

        Args:
            rows: How many rows, all alike.
        """
        import numpy as np

        base = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] if self.floating else []
        row = np.array([*base, *self._about["pose"], *self._about["rest"]])
        return np.tile(row, (rows, 1))

    def _values(self, parameters: ArrayLike | Mapping[str, float] | None) -> ArrayLike | None:
        if not isinstance(parameters, Mapping):
            return parameters
        values, names = self.parameter_values, self.parameter_names
        for name, value in parameters.items():
            if name not in names:
                near = difflib.get_close_matches(name, names, 1)
                raise KeyError(f"no parameter {name!r}; {f'is {near[0]!r} meant? ' if near else ''}parameter_names lists them")
            values[names.index(name)] = value
        return values

    def random_states(self, rows: int, seed: int = 0) -> tuple[Array, Array, Array]:
        """Random positions ``(rows, nq)``, velocities and accelerations ``(rows, nv)``: attitudes of all directions, joints within 1.5 rad or
        0.5 m of the nominal pose, normal velocities and accelerations of deviation 1 (SI).

        Args:
            rows: How many states.
            seed: Seed of the numbers.
        """
        import numpy as np

        r = np.random.default_rng(seed)
        q = self.neutral(rows)
        moving = q.shape[1] - (7 if self.floating else 0)
        if self.floating:
            q[:, :3] = r.normal(size=(rows, 3))
            attitude = r.normal(size=(rows, 4))
            q[:, 3:7] = attitude / np.linalg.norm(attitude, axis=1)[:, None]
        slides = np.array(self._about["slides"], dtype=bool)
        reach = np.concatenate([np.where(slides, 0.5, 1.5), np.full(moving - len(slides), 0.3)])
        q[:, q.shape[1] - moving :] += r.uniform(-1.0, 1.0, size=(rows, moving)) * reach
        return q, r.normal(size=(rows, self.nv)), r.normal(size=(rows, self.nv))

    def base_parameters(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        a: ArrayLike | None = None,
        *,
        tolerance: float = 1e-9,
        threads: int = 0,
    ) -> BaseParameters:
        """Base parameters: what no motion, or not these motions, can tell apart is one number (M. Gautier, J. Robotic Systems 8(4), 1991).

        Args:
            q: Positions ``(N, nq)``; random states unless given, so that what is left is what the structure of the robot hides.
            v: Velocities ``(N, nv)``; all three are given, or none.
            a: Accelerations ``(N, nv)``.
            tolerance: Singular values below this part of the largest are zero.
            threads: Most threads; 0 for all cores.
        """
        if not (0.0 < tolerance < 1.0):
            raise ValueError(f"tolerance is {tolerance}, limits 0 < tolerance < 1")
        if q is None and v is None and a is None:
            q, v, a = self.random_states(4 * len(self.parameter_names) // self.nv + 64)
        if q is None or v is None or a is None:
            raise TypeError("give q, v and a, or none of them")
        kept, matrix, condition = self._core.base_parameters(q, v, a, tolerance, _threads(threads))
        names = self.parameter_names

        def term(factor: float, name: str) -> str:
            if factor == 1.0:
                return f" + {name}"
            return f" {'-' if factor < 0 else '+'} {abs(factor):.6g} {name}"

        def words(row: Any, own: int) -> str:
            order = [own, *(k for k in row.nonzero()[0] if k != own)]
            return "".join(term(float(row[k]), names[k]) for k in order).removeprefix(" + ")

        return BaseParameters(kept, matrix, condition, [words(row, k) for row, k in zip(matrix, kept)])

    def _run(
        self,
        algorithm: str,
        q: ArrayLike,
        v: ArrayLike | None,
        given: ArrayLike | None,
        parameters: ArrayLike | Mapping[str, float] | None,
        out: Array | None,
        threads: int,
        frame: str | None = None,
        shape: tuple[int, ...] = (),
    ) -> Array:
        flat = out
        if out is not None and shape and out.ndim == len(shape) + 1 and out.shape[1:] == shape and out.flags.c_contiguous:
            # A view: results are written into the array that was given.
            flat = out.reshape(out.shape[0], -1)
        x = self._core.batch(algorithm, frame, q, v, given, self._values(parameters), flat, _threads(threads))
        return x.reshape(x.shape[0], *shape) if shape else x

    def rnea(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Array:
        """Inverse dynamics ``tau = H(q) a + c(q, v)``, ``(N, nv)``: base wrench (base axes, about the base origin), joint torques, passive
        rows. Recursive Newton-Euler algorithm."""
        return self._run("rnea", q, v, a, parameters, out, threads)

    def mass_matrix(
        self,
        q: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Array:
        """Mass matrix ``H(q)``, ``(N, nv, nv)`` (kg, kg m, kg m^2). Composite rigid body algorithm."""
        return self._run("mass_matrix", q, None, None, parameters, out, threads, shape=(self.nv, self.nv))

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Array:
        """Accelerations ``(N, nv)`` under generalised forces ``tau`` ``(N, nv)``."""
        return self._run("forward_dynamics", q, v, tau, parameters, out, threads)

    def hybrid_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        qdd: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Hybrid:
        """All accelerations and the joint torques at joint accelerations ``qdd`` ``(N, n)``, base and appendages free. ``out`` is
        ``(N, nv + n)``: accelerations, then torques."""
        x = self._run("hybrid_dynamics", q, v, qdd, parameters, out, threads)
        return Hybrid(x[:, : self.nv], x[:, self.nv :])

    def regressor(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Array:
        """``Y = d tau / d parameters``, ``(N, nv, n_params)``; for rigid bodies ``tau = Y phi``, ten parameters a body: mass, first moments
        of mass, inertia about the origin of the link."""
        shape = (self.nv, len(self.parameter_names))
        return self._run("regressor", q, v, a, parameters, out, threads, shape=shape)

    def regressor_qr(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, tau: ArrayLike | None = None, *, threads: int = 0
    ) -> Array:
        """The triangle ``R`` of ``[Y tau] = Q R`` over all rows, without the rows: ``(n_params, n_params)``, one more with ``tau``."""
        return self._core.regressor_triangle(q, v, a, tau, _threads(threads))

    def derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Derivatives:
        """Derivatives of :meth:`rnea` by positions, velocities and accelerations. ``out`` is ``(N, 3, nv, nv)``."""
        x = self._run("derivatives", q, v, a, parameters, out, threads, shape=(3, self.nv, self.nv))
        return Derivatives(x[:, 0], x[:, 1], x[:, 2])

    def momentum(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        parameters: ArrayLike | Mapping[str, float] | None = None,
        out: Array | None = None,
        threads: int = 0,
    ) -> Momentum:
        """Momentum and energy. ``out`` is ``(N, 14)``: the fields in order."""
        x = self._run("momentum", q, v, None, parameters, out, threads)
        return Momentum(x[:, 0:3], x[:, 3:6], x[:, 6:9], x[:, 9:12], x[:, 12], x[:, 13])

    def frame(self, name: str, q: ArrayLike, *, out: Array | None = None, threads: int = 0) -> Array:
        """Pose of the frame called ``name`` in the world as homogeneous transforms, ``(N, 4, 4)`` (m)."""
        return self._run("frame_pose", q, None, None, None, out, threads, name, (4, 4))

    def frame_jacobian(self, name: str, q: ArrayLike, *, out: Array | None = None, threads: int = 0) -> Array:
        """Jacobian of the frame called ``name`` in its own axes, linear rows first, ``(N, 6, nv)``."""
        return self._run("frame_jacobian", q, None, None, None, out, threads, name, (6, self.nv))

    def __repr__(self) -> str:
        return f"Model({self.name!r}, joints={len(self.joints)}, nv={self.nv}, {'floating' if self.floating else 'fixed'} base)"


def _threads(threads: int) -> int:
    if threads < 0:
        raise ValueError(f"threads is {threads}, limit >= 0 (0 for all cores)")
    return threads
