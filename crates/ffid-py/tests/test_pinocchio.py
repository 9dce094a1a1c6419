"""The dynamics over arrays against Pinocchio, to 1e-11 of the largest number."""

from __future__ import annotations

import re
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

import ffid
import numpy as np
import pytest

pin = pytest.importorskip("pinocchio")
pytestmark = pytest.mark.filterwarnings("ignore::ffid.FfidWarning")

TOLERANCE = 1e-11
ROWS = 37


def robots() -> dict[str, tuple[Path, str]]:
    fixtures = Path(__file__).resolve().parents[3] / "fixtures"
    found = {
        f"{n}-{base}": (fixtures / "peers-model" / f"{n}.urdf", base) for n in ("flex",) for base in ("floating", "fixed")
    }
    # Where the wheel of example-robot-data puts them; the same robots are in its other layouts by name.
    root = Path(sysconfig.get_path("purelib")) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
    for name, file in (("panda", "panda.urdf"), ("ur5", "ur5_robot.urdf"), ("kinova", "kinova.urdf")):
        for path in sorted(root.rglob(file))[:1]:
            found |= {f"{name}-{base}": (path, base) for base in ("floating", "fixed")}
    return found


class Pair:
    """A robot in both, and the same motions in the order of each."""

    def __init__(self, path: Path, base: str) -> None:
        floats = base == "floating"
        gravity = (0.3, -0.2, -9.81)
        # Most of Pinocchio's algorithms take no mimic joints: here every joint moves by itself, `test_mimic_joints` has the others.
        text = re.sub(r"<mimic[^>]*/>", "", path.read_text())
        copy = Path(tempfile.mkdtemp()) / path.name
        copy.write_text(text)
        path = copy
        self.ours = ffid.Model.from_urdf(path, base=base, gravity=gravity)  # type: ignore[arg-type]
        self.model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer()) if floats else pin.buildModelFromUrdf(str(path))
        self.model.gravity.linear = np.array(gravity)
        # What ours holds where it is, Pinocchio is told to hold as well.
        held = [self.model.getJointId(n) for n in self.model.names if n not in ("universe", "root_joint", *self.ours.joints)]
        self.model = pin.buildReducedModel(self.model, held, pin.neutral(self.model))
        self.names = [n for n in self.model.names if n not in ("universe", "root_joint")]
        assert set(self.names) == set(self.ours.joints)
        self.data = self.model.createData()
        r = np.random.default_rng(7)
        b = 6 if floats else 0
        n = len(self.names)
        self.columns = [b + self.ours.joints.index(j) for j in self.names]
        self.order = np.array([*range(b), *self.columns])
        self.q = np.zeros((ROWS, self.ours.nq))
        if floats:
            self.q[:, :3] = r.normal(size=(ROWS, 3))
            att = r.normal(size=(ROWS, 4))
            self.q[:, 3:7] = att / np.linalg.norm(att, axis=1)[:, None]
        self.q[:, -n:] = r.uniform(-1.2, 1.2, size=(ROWS, n))
        self.v, self.a = r.normal(size=(2, ROWS, self.ours.nv))
        theirs = np.zeros((ROWS, self.model.nq))
        if floats:
            theirs[:, :3], theirs[:, 3:6], theirs[:, 6] = self.q[:, :3], self.q[:, 4:7], self.q[:, 3]
        for name, column in zip(self.names, self.columns):
            joint, q = self.model.joints[self.model.getJointId(name)], self.q[:, -n + column - b]
            # A joint without limits is the cosine and sine of its angle in Pinocchio.
            theirs[:, joint.idx_q] = q if joint.nq == 1 else np.cos(q)
            if joint.nq == 2:
                theirs[:, joint.idx_q + 1] = np.sin(q)
        self.theirs = (theirs, self.v[:, self.order], self.a[:, self.order])


@pytest.fixture(params=sorted(robots()))
def pair(request: Any) -> Pair:
    return Pair(*robots()[request.param])


def same(ours: Any, theirs: Any) -> None:
    theirs = np.asarray(theirs)
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() <= TOLERANCE * max(np.abs(theirs).max(), 1e-9)


def test_forces_accelerations_and_inertia(pair: Pair) -> None:
    m, d, o = pair.model, pair.data, pair.order
    rows = list(zip(*pair.theirs))
    tau = np.array([pin.rnea(m, d, *row) for row in rows])
    same(pair.ours.rnea(pair.q, pair.v, pair.a)[:, o], tau)
    h = np.array([(lambda x: np.triu(x) + np.triu(x, 1).T)(pin.crba(m, d, q)) for q, _, _ in rows])
    same(pair.ours.mass_matrix(pair.q)[:, o][:, :, o], h)
    back = pair.ours.forward_dynamics(pair.q, pair.v, pair.ours.rnea(pair.q, pair.v, pair.a))
    assert np.abs(back - pair.a).max() < 1e-8
    dq, dv, da = pair.ours.derivatives(pair.q, pair.v, pair.a)
    theirs = [tuple(np.array(x) for x in pin.computeRNEADerivatives(m, d, *row)) for row in rows]
    same(dv[:, o][:, :, o], [x[1] for x in theirs])
    same(da[:, o][:, :, o], h)


def test_mimic_joints() -> None:
    found = [path for name, (path, base) in robots().items() if name == "panda-floating"]
    if not found:
        pytest.skip("example-robot-data is not installed")
    ours = ffid.Model.from_urdf(found[0])
    m = pin.buildModelFromUrdf(str(found[0]), pin.JointModelFreeFlyer(), mimic=True)
    m.gravity.linear = np.zeros(3)
    own = [n for n in m.names if n not in ("universe", "root_joint") and m.joints[m.getJointId(n)].nv == 1]
    assert set(own) == set(ours.joints) and "panda_finger_joint2" not in ours.joints
    order = np.array([*range(6), *(6 + ours.joints.index(n) for n in own)])
    r = np.random.default_rng(11)
    q = np.zeros((ROWS, ours.nq))
    q[:, :3], att, q[:, 7:] = r.normal(size=(ROWS, 3)), r.normal(size=(ROWS, 4)), r.uniform(-1.2, 1.2, size=(ROWS, len(own)))
    q[:, 3:7] = att / np.linalg.norm(att, axis=1)[:, None]
    v, a = r.normal(size=(2, ROWS, ours.nv))
    theirs = q[:, [0, 1, 2, 4, 5, 6, 3, *(order[6:] + 1)]]
    # Data anew each time: Pinocchio adds what mimic joints contribute to the mass matrix of the call before.
    tau = np.array([pin.rnea(m, m.createData(), *row) for row in zip(theirs, v[:, order], a[:, order])])
    same(ours.rnea(q, v, a)[:, order], tau)
    h = np.array([(lambda x: np.triu(x) + np.triu(x, 1).T)(np.array(pin.crba(m, m.createData(), row))) for row in theirs])
    same(ours.mass_matrix(q)[:, order][:, :, order], h)
    assert np.abs(ours.forward_dynamics(q, v, ours.rnea(q, v, a)) - a).max() < 1e-8


def test_the_regressor_and_its_triangle(pair: Pair) -> None:
    m, d, o = pair.model, pair.data, pair.order
    rows = list(zip(*pair.theirs))
    y = pair.ours.regressor(pair.q, pair.v, pair.a)
    tau = pair.ours.rnea(pair.q, pair.v, pair.a)
    same(y @ pair.ours.parameter_values, tau)
    their_y = np.array([np.array(pin.computeJointTorqueRegressor(m, d, *row)) for row in rows])
    # Theirs has no columns of the base of a robot that is bolted down, and the bodies in the order of its joints.
    bodies = [0] if pair.ours.floating else []
    bodies += [1 + pair.ours.joints.index(j) for j in pair.names]
    columns = [10 * b + k for b in bodies for k in range(10)]
    same(y[:, o][:, :, columns], their_y)
    r = pair.ours.regressor_qr(pair.q, pair.v, pair.a)
    flat = y.reshape(-1, y.shape[2])
    assert np.abs(r.T @ r - flat.T @ flat).max() <= 1e-10 * np.abs(flat.T @ flat).max()
    wide = pair.ours.regressor_qr(pair.q, pair.v, pair.a, tau)
    # Exact forces leave nothing.
    assert abs(wide[-1, -1]) <= 1e-8 * np.linalg.norm(tau)


def test_frames_and_momentum(pair: Pair) -> None:
    m, d = pair.model, pair.data
    common = [f for f in pair.ours.frames if m.existFrame(f)][-2:]
    qs, vs, _ = pair.theirs
    for name in common:
        k = m.getFrameId(name)
        poses, jacobians = [], []
        for q in qs:
            pin.framesForwardKinematics(m, d, q)
            poses.append(d.oMf[k].homogeneous.copy())
            jacobians.append(pin.computeFrameJacobian(m, d, q, k, pin.LOCAL).copy())
        same(pair.ours.frame(name, pair.q), poses)
        same(pair.ours.frame_jacobian(name, pair.q)[:, :, pair.order], jacobians)
    found = pair.ours.momentum(pair.q, pair.v)
    kinetic = np.array([pin.computeKineticEnergy(m, d, q, v) for q, v in zip(qs, vs)])
    same(found.kinetic, kinetic)
    if pair.ours.floating:
        linear = [pin.computeCentroidalMomentum(m, d, q, v).linear.copy() for q, v in zip(qs, vs)]
        same(found.linear, linear)


def test_threads_and_rows_do_not_matter(pair: Pair) -> None:
    many = [np.tile(x, (40, 1)) for x in (pair.q, pair.v, pair.a)]
    one = pair.ours.rnea(*many, threads=1)
    assert np.array_equal(one, pair.ours.rnea(*many, threads=5))
    same(one[:ROWS], np.vstack([pair.ours.rnea(*(x[i : i + 1] for x in many)) for i in range(ROWS)]))


def test_parameters_by_name_and_by_array(pair: Pair) -> None:
    name = pair.ours.parameter_names[-10]
    values = pair.ours.parameter_values
    values[-10] += 2.5
    changed = pair.ours.rnea(pair.q, pair.v, pair.a, parameters={name: values[-10]})
    assert np.array_equal(changed, pair.ours.rnea(pair.q, pair.v, pair.a, parameters=values))
    plain = pair.ours.rnea(pair.q, pair.v, pair.a)
    y = pair.ours.regressor(pair.q, pair.v, pair.a)
    same(changed - plain, 2.5 * y[:, :, -10])
    with pytest.raises(KeyError):
        pair.ours.rnea(pair.q, pair.v, pair.a, parameters={"no.such": 1.0})


def test_base_parameters_tell_all_that_the_forces_tell(pair: Pair) -> None:
    base = pair.ours.base_parameters()
    y = pair.ours.regressor(pair.q, pair.v, pair.a)
    phi = pair.ours.parameter_values
    # Of another robot than the one they were computed for: the structure counts, not the values.
    other = phi * np.random.default_rng(5).uniform(0.5, 2.0, size=phi.shape)
    for values in (phi, other):
        same(y[:, :, base.kept] @ (base.matrix @ values), pair.ours.rnea(pair.q, pair.v, pair.a, parameters=values))
    assert base.kept == sorted(base.kept) and np.array_equal(base.matrix[:, base.kept], np.eye(len(base.kept)))
    # As many as there are independent columns, and each of them is needed. Columns of one length: a parameter that is nearly zero, as
    # products of inertia of real robots are, counts as any other.
    flat = y.reshape(-1, y.shape[2])
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-9 * np.linalg.norm(flat))
    assert len(base.kept) == np.linalg.matrix_rank(flat, tol=1e-9 * np.linalg.norm(flat, 2)) < len(phi)
    assert base.condition < 1e6 and base.expressions[0].startswith(pair.ours.parameter_names[base.kept[0]])


def test_base_parameters_of_a_motion(pair: Pair) -> None:
    # A robot that stands still feels weights and no inertia: it tells less. Where its base moves freely, one pose of the joints tells as much
    # as all of them: seven combinations of each subtree, as the structure allows.
    still = np.zeros_like(pair.v)
    less = pair.ours.base_parameters(pair.q, still, still)
    assert len(less.kept) < len(pair.ours.base_parameters().kept)
    y = pair.ours.regressor(pair.q, still, still)
    same(y[:, :, less.kept] @ (less.matrix @ pair.ours.parameter_values), pair.ours.rnea(pair.q, still, still))
    if pair.ours.nv > len(pair.ours.joints):
        v, a = still.copy(), still.copy()
        v[:, :6], a[:, :6] = pair.v[:, :6], pair.a[:, :6]
        one = pair.ours.base_parameters(np.repeat(pair.q[:1], len(pair.q), axis=0), v, a)
        assert len(one.kept) == len(pair.ours.base_parameters().kept)


def test_forward_and_hybrid_dynamics_agree_with_inverse(pair: Pair) -> None:
    h = pair.ours.hybrid_dynamics(pair.q, pair.v, pair.a[:, pair.ours.nv - len(pair.ours.joints) :])
    tau = pair.ours.rnea(pair.q, pair.v, h.a)
    n, b = len(pair.ours.joints), pair.ours.nv - len(pair.ours.joints)
    scale = np.abs(tau).max()
    assert np.abs(tau[:, b:] - h.tau).max() <= 1e-9 * scale and h.tau.shape == (ROWS, n)
    # The base is free.
    assert np.abs(tau[:, :b]).max(initial=0.0) <= 1e-9 * scale
    m, d = pair.model, pair.data
    forces = pair.a[:, pair.order]
    theirs = [pin.aba(m, d, q, v, t) for (q, v, _), t in zip(zip(*pair.theirs), forces)]
    ours = pair.ours.forward_dynamics(pair.q, pair.v, pair.a)[:, pair.order]
    assert np.abs(ours - theirs).max() <= 1e-9 * np.abs(theirs).max()
