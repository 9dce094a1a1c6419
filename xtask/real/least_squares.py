#!/usr/bin/env python3
"""Ordinary, weighted and instrumental-variable least squares on Pinocchio's regressor, for `cargo xtask study real`.

    python least_squares.py ROBOT.urdf TRAIN.csv HELD_OUT.csv [result.json] > scores.json

Needs numpy, scipy and pin (`pip install numpy scipy pin`). The friction of every joint is viscous, Coulomb and an offset, as that of `ffid`
without further terms. Logs have the columns of docs/records.md. What is tuned, the low pass of positions and torques, is chosen on the
training log alone: each half predicts the other. All methods are scored on the held-out log behind the same filter: torque minus
prediction behind a zero-phase Butterworth filter of order four at 10 Hz, root mean square of each joint; motion passes the same filter.
`result.json` is that of an identification by `ffid`: its parameters and terms of the joints predict the same samples.
"""
import json
import sys

import numpy as np
import pinocchio as pin
from scipy.interpolate import interp1d
from scipy.signal import butter, filtfilt

JUDGED_HZ = 10.0
CUTOFFS_HZ = [2.5, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 40.0]


def low_pass(x, rate, hz):
    b, a = butter(4, hz / (0.5 * rate))
    return filtfilt(b, a, x, axis=0)


def read(path, joints):
    with open(path) as f:
        head = [c.strip() for c in f.readline().split(",")]
    data = np.genfromtxt(path, delimiter=",", skip_header=1)
    names = [c.split("[")[0] for c in head]
    column = lambda n: data[:, names.index(n)]
    t = column("time")
    keep = np.concatenate([[True], np.diff(t) > 0])
    t = t[keep] - t[0]
    q = np.stack([column(f"q.{j}")[keep] for j in joints], 1)
    tau = np.stack([column(f"tau.{j}")[keep] for j in joints], 1)
    # An even clock at the usual rate.
    dt = np.median(np.diff(t))
    grid = np.arange(0.0, t[-1], dt)
    on = lambda x: interp1d(t, x, axis=0, kind="linear")(grid)
    return {"rate": 1.0 / dt, "t": grid, "q": on(q), "tau": on(tau)}


def motion(q, rate, hz):
    q = low_pass(q, rate, hz)
    qd = np.gradient(q, 1.0 / rate, axis=0)
    return q, qd, np.gradient(qd, 1.0 / rate, axis=0)


def rows(model, q, qd, qdd):
    """Columns of bodies and friction, samples x joints x unknowns."""
    data = model.createData()
    n, joints = q.shape
    nb = 10 * (model.njoints - 1)
    out = np.zeros((n, joints, nb + 3 * joints))
    # A joint without limits is given by cosine and sine.
    config = np.zeros((n, model.nq))
    for j in range(joints):
        of = model.joints[j + 1]
        if of.nq == 2:
            config[:, of.idx_q], config[:, of.idx_q + 1] = np.cos(q[:, j]), np.sin(q[:, j])
        else:
            config[:, of.idx_q] = q[:, j]
    for i in range(n):
        out[i, :, :nb] = pin.computeJointTorqueRegressor(model, data, config[i], qd[i], qdd[i])
    for j in range(joints):
        out[:, j, nb + 3 * j] = qd[:, j]
        out[:, j, nb + 3 * j + 1] = np.sign(qd[:, j])
        out[:, j, nb + 3 * j + 2] = 1.0
    return out


def part(log, from_, to):
    n = len(log["q"])
    cut = slice(int(from_ * n), int(to * n))
    return {"rate": log["rate"], "q": log["q"][cut], "tau": log["tau"][cut]}


def prepared(model, log, hz):
    q, qd, qdd = motion(log["q"], log["rate"], hz)
    r = rows(model, q, qd, qdd)
    r = low_pass(r.reshape(len(r), -1), log["rate"], hz).reshape(r.shape)
    tau = low_pass(log["tau"], log["rate"], hz)
    cut = int(log["rate"] / hz) + 1
    return r[cut:-cut], tau[cut:-cut], np.abs(qd[cut:-cut]) > 0.01


def stacked(r, tau, moves, weights):
    a, b = [], []
    for j, w in enumerate(weights):
        a.append(r[moves[:, j], j] * w)
        b.append(tau[moves[:, j], j] * w)
    return np.concatenate(a), np.concatenate(b)


def solve(a, b):
    size = np.sqrt((a**2).mean(0)) + 1e-12
    return np.linalg.lstsq(a / size, b, rcond=1e-6)[0] / size


def residual_weights(r, tau, moves, x):
    return [1.0 / max(np.sqrt(np.mean((tau[:, j] - r[:, j] @ x)[moves[:, j]] ** 2)), 1e-9) for j in range(tau.shape[1])]


def ordinary(model, log, hz):
    r, tau, moves = prepared(model, log, hz)
    return solve(*stacked(r, tau, moves, np.ones(tau.shape[1])))


def weighted(model, log, hz):
    r, tau, moves = prepared(model, log, hz)
    x = solve(*stacked(r, tau, moves, np.ones(tau.shape[1])))
    for _ in range(3):
        x = solve(*stacked(r, tau, moves, residual_weights(r, tau, moves, x)))
    return x


def instrumental(model, log, hz):
    """Instruments are the regressor of every other sample, whose encoder noise is another."""
    even, odd = ({"rate": 0.5 * log["rate"], "q": log["q"][k::2], "tau": log["tau"][k::2]} for k in (0, 1))
    n = min(len(even["q"]), len(odd["q"]))
    # Between neighbours, so that both stand at one time.
    shifted = {**odd, "q": 0.5 * (odd["q"][: n - 1] + odd["q"][1:n])}
    even = {**even, "q": even["q"][1:n], "tau": even["tau"][1:n]}
    hz = min(hz, 0.2 * even["rate"])
    r, tau, moves = prepared(model, even, hz)
    z, _, _ = prepared(model, {**even, "q": shifted["q"]}, hz)
    x = solve(*stacked(r, tau, moves, np.ones(tau.shape[1])))
    for _ in range(3):
        w = residual_weights(r, tau, moves, x)
        a, b = stacked(r, tau, moves, w)
        c, _ = stacked(z, tau, moves, w)
        size = np.sqrt((a**2).mean(0)) + 1e-12
        a, c = a / size, c / size
        # Of the regressor, what the instruments tell: two-stage least squares on the base parameters.
        u, s, _ = np.linalg.svd(c, full_matrices=False)
        u = u[:, s > 1e-6 * s[0]]
        x = np.linalg.lstsq(u @ (u.T @ a), b, rcond=1e-6)[0] / size
    return x


def judge(model, log, x):
    q, qd, qdd = motion(log["q"], log["rate"], JUDGED_HZ)
    predicted = rows(model, q, qd, qdd) @ x
    return scored(log["tau"], predicted, log["rate"])


def scored(tau, predicted, rate):
    error = low_pass(tau - predicted, rate, JUDGED_HZ)
    cut = int(rate / JUDGED_HZ) * 2
    return np.sqrt(np.mean(error[cut:-cut] ** 2, 0))


NUMBERS = ["mass", "h_x", "h_y", "h_z", "i_xx", "i_xy", "i_yy", "i_xz", "i_yz", "i_zz"]


def of_result(model, joints, result, q, qd, qdd, hz):
    """Torques by the parameters of a result of ffid, which are those of Pinocchio's regressor in its order, and its terms of joints."""
    values = {p["name"]: p["value"] for p in result["model"]}
    links = [next(f.name for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == j + 1) for j in range(len(joints))]
    x = np.array([values[f"{link}.{n}"] for link in links for n in NUMBERS])
    rigid = rows(model, q, qd, qdd)[:, :, : len(x)] @ x
    bends = {p["name"].split(".", 1)[1]: p["value"] for p in result["nuisance"] if p["name"].startswith("compliance.")}
    if bends:
        # Encoders sit before joints that bend: the links are behind by compliance times torque.
        bent = rigid * np.array([bends.get(j, 0.0) for j in joints])
        rate = np.gradient(bent, 1 / hz, axis=0)
        q, qd, qdd = q - bent, qd - rate, qdd - np.gradient(rate, 1 / hz, axis=0)
        rigid = rows(model, q, qd, qdd)[:, :, : len(x)] @ x
    out = rigid.copy()
    for p in (p for p in result["nuisance"] if not p["name"].startswith("compliance.")):
        kind, joint, term = p["name"].split(".", 2)
        j = joints.index(joint)
        w, s = qd[:, j], np.sign(qd[:, j])
        if kind == "drive":
            factor = qdd[:, j]
        elif term.startswith("stribeck@"):
            factor = np.exp(-np.abs(w) / float(term.split("@")[1])) * s
        else:
            factor = {"viscous": w, "coulomb": s, "offset": 1.0, "asymmetry": np.abs(w), "quadratic": w * np.abs(w), "load": np.abs(rigid[:, j]) * s}[term]
        out[:, j] += p["value"] * factor
    return out


def tuned(model, log, method):
    """The cutoff by which each half predicts the other best."""
    halves = [part(log, 0.0, 0.5), part(log, 0.5, 1.0)]
    size = np.sqrt(np.mean(log["tau"] ** 2, 0))
    best = (np.inf, None)
    for hz in [hz for hz in CUTOFFS_HZ if hz <= 0.1 * log["rate"]]:
        error = sum(np.mean((judge(model, b, method(model, a, hz)) / size) ** 2) for a, b in (halves, halves[::-1]))
        best = min(best, (float(error), hz))
    return best[1]


def main():
    urdf, train, held = sys.argv[1:4]
    model = pin.buildModelFromUrdf(urdf)
    joints = [model.names[i] for i in range(1, model.njoints)]
    train, held = read(train, joints), read(held, joints)
    out = {"joints": joints, "torque_rms": list(scored(held["tau"], 0 * held["tau"], held["rate"])), "methods": {}}
    for name, method in [("ordinary", ordinary), ("weighted", weighted), ("instrumental", instrumental)]:
        hz = tuned(model, train, method)
        out["methods"][name] = {"low_pass_hz": hz, "rms": list(judge(model, held, method(model, train, hz)))}
    if len(sys.argv) > 4:
        with open(sys.argv[4]) as f:
            result = json.load(f)
        q, qd, qdd = motion(held["q"], held["rate"], JUDGED_HZ)
        predicted = of_result(model, joints, result, q, qd, qdd, held["rate"])
        out["methods"]["ffid"] = {"rms": list(scored(held["tau"], predicted, held["rate"]))}
    json.dump(out, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
