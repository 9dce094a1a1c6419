"""Dynamics over 10,000 states beside a loop over Pinocchio's Python bindings and beside the same in Rust; an identification from arrays
beside the same in Rust; the time of the import. In turn within one run.

Usage: python bench/dynamics.py [--json FILE] [--rows N] [--rounds K] [--fits K] [--rust PROGRAM]

PROGRAM is that of bench/rust; without it nothing is compared with Rust. Times are the least of all rounds, in seconds. Every comparison with
Pinocchio is checked for equal results first. A limit that is broken ends with 15.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ffid
import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[3]
LIMITS = {"rnea": 25.0, "mass_matrix": 6.0, "regressor": 2.0, "regressor_qr": 5.0}
# Most times what Rust takes, and most seconds of the import.
OVER_RUST, OVER_RUST_IDENTIFY, IMPORT_S = 1.3, 1.05, 0.2


def timed(f: Callable[[], Any]) -> float:
    begun = time.perf_counter()
    f()
    return time.perf_counter() - begun


def in_rust(program: Path, rows: int, fits: int) -> dict[str, float]:
    """The least times of the same in Rust."""
    verdict = ROOT / "fixtures" / "verdict"
    words = [ROOT / "fixtures" / "peers-model" / "flex.urdf", rows, 5, verdict / "start.toml", verdict / "m1.parquet", fits]
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=True)
    times: dict[str, float] = json.loads(done.stdout)
    return times


def fit() -> tuple[Callable[[], Any], float]:
    """An identification from arrays, and what it took the first time."""
    folder = ROOT / "fixtures" / "verdict"
    mission = ffid.Mission.load(folder / "start.toml")
    record = ffid.Record.read(folder / "m1.parquet", mission)
    t, q, tau, gyro = record.t, record.q, record.tau, record.gyro

    def identify() -> Any:
        return ffid.identify(mission, ffid.Record.from_arrays(mission, t=t, q=q, tau=tau, gyro=gyro))

    return identify, timed(identify)


def imported() -> float:
    """Seconds of the processor for ``import ffid`` in a new interpreter, NumPy included: what else the machine does plays no part."""
    code = "import time; t = time.process_time(); import ffid; print(time.process_time() - t)"
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--json", type=Path)
    arguments.add_argument("--rows", type=int, default=10_000)
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--fits", type=int, default=5)
    arguments.add_argument("--rust", type=Path)
    given = arguments.parse_args()
    warnings.simplefilter("ignore", ffid.FfidWarning)
    rows = given.rows
    urdf = ROOT / "fixtures" / "peers-model" / "flex.urdf"
    ours = ffid.Model.from_urdf(urdf)
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    model.gravity.linear = np.zeros(3)
    data = model.createData()
    joints = [n for n in model.names if n not in ("universe", "root_joint")]
    order = np.array([*range(6), *(6 + ours.joints.index(j) for j in joints)])
    r = np.random.default_rng(1)
    q = np.zeros((rows, ours.nq))
    att = r.normal(size=(rows, 4))
    q[:, 3:7] = att / np.linalg.norm(att, axis=1)[:, None]
    q[:, 7:] = r.uniform(-1, 1, size=(rows, ours.nq - 7))
    v, a = r.normal(size=(2, rows, ours.nv))
    pq = q.copy()
    pq[:, 3:6], pq[:, 6] = q[:, 4:7], q[:, 3]
    pq[:, 7:] = q[:, 7:][:, order[6:] - 6]
    pv, pa = v[:, order].copy(), a[:, order].copy()
    nv, parameters = ours.nv, len(ours.parameter_names)
    forces, inertias = np.empty((rows, nv)), np.empty((rows, nv, nv))
    y, theirs = np.empty((rows, nv, parameters)), np.empty((rows, nv, parameters))

    def rnea() -> None:
        for i in range(rows):
            forces[i] = pin.rnea(model, data, pq[i], pv[i], pa[i])

    def crba() -> None:
        for i in range(rows):
            inertias[i] = pin.crba(model, data, pq[i])

    def regressor() -> None:
        for i in range(rows):
            theirs[i] = pin.computeJointTorqueRegressor(model, data, pq[i], pv[i], pa[i])

    def rows_qr() -> Any:
        regressor()
        return np.linalg.qr(theirs.reshape(-1, parameters), mode="r")

    rnea(), crba(), regressor()
    h = np.triu(inertias) + np.triu(inertias, 1).transpose(0, 2, 1)
    scale = np.abs(forces).max()
    assert np.abs(ours.rnea(q, v, a)[:, order] - forces).max() <= 1e-11 * scale
    assert np.abs(ours.mass_matrix(q)[:, order][:, :, order] - h).max() <= 1e-11 * np.abs(h).max()
    ours_r = ours.regressor_qr(q, v, a)
    gram = np.einsum("nij,nik->jk", theirs, theirs)
    columns = [10 * b + k for b in [0, *(1 + ours.joints.index(j) for j in joints)] for k in range(10)]
    assert np.abs((ours_r.T @ ours_r)[np.ix_(columns, columns)] - gram).max() <= 1e-10 * np.abs(gram).max()
    out, outm = np.empty_like(forces), np.empty_like(inertias)
    pairs: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
        "rnea": (lambda: ours.rnea(q, v, a, out=out), rnea),
        "mass_matrix": (lambda: ours.mass_matrix(q, out=outm), crba),
        "regressor": (lambda: ours.regressor(q, v, a, out=y), regressor),
        "regressor_qr": (lambda: ours.regressor_qr(q, v, a), rows_qr),
    }
    results: list[dict[str, Any]] = []
    rust: dict[str, float] = {}

    def least_in_rust(fits: int) -> None:
        for name, seconds in (in_rust(given.rust, rows, fits) if given.rust else {}).items():
            rust[name] = min(seconds, rust.get(name, seconds))

    for name, (mine, peer) in pairs.items():
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(given.rounds):
            # Several, as one is over in a moment in which other programs may run.
            times[0].extend(timed(mine) for _ in range(5 if name != "regressor_qr" else 1))
            times[1].append(timed(peer))
        least_in_rust(0)
        times[0].extend(timed(mine) for _ in range(5))
        one = min(times[0])
        ratio = min(times[1]) / one
        row = {"name": name, "rows": rows, "ffid_s": one, "pinocchio_s": min(times[1]), "faster": ratio, "limit": LIMITS[name]}
        results.append(row | {"holds": ratio >= LIMITS[name]})
        each, theirs_each = 1e6 * one / rows, 1e6 * min(times[1]) / rows
        print(f"{name:14} {each:9.3f} us {theirs_each:9.3f} us of Pinocchio   {ratio:6.1f} times (limit {LIMITS[name]:g})")
    for name, own in rust.items():
        mine = next(r["ffid_s"] for r in results if r["name"] == name)
        results.append({"name": f"{name}, over Rust", "ffid_s": mine, "rust_s": own, "times": mine / own, "limit": OVER_RUST, "holds": mine <= OVER_RUST * own})
        print(f"{name:14} {1e6 * mine / rows:9.3f} us {1e6 * own / rows:9.3f} us in Rust       {mine / own:6.2f} times (limit {OVER_RUST:g})")
    if given.rust and given.fits:
        identify, _ = fit()
        mine = float("inf")
        for _ in range(given.fits):
            least_in_rust(1)
            mine = min(mine, timed(identify))
        own = rust["identify"]
        results.append({"name": "identify, over Rust", "ffid_s": mine, "rust_s": own, "times": mine / own, "limit": OVER_RUST_IDENTIFY, "holds": mine <= OVER_RUST_IDENTIFY * own})
        print(f"identify       {mine:9.3f} s  {own:9.3f} s in Rust        {mine / own:6.3f} times (limit {OVER_RUST_IDENTIFY:g})")
    seconds = min(imported() for _ in range(5))
    results.append({"name": "import", "ffid_s": seconds, "limit": IMPORT_S, "holds": seconds <= IMPORT_S})
    print(f"import         {seconds:9.3f} s (limit {IMPORT_S:g})")
    if given.json:
        about = {"cores": os.cpu_count(), "pinocchio": pin.__version__, "numpy": np.__version__, "ffid": ffid.__version__}
        given.json.write_text(json.dumps({"about": about, "results": results}, indent=2) + "\n")
    return 0 if all(r["holds"] for r in results) else 15


if __name__ == "__main__":
    sys.exit(main())
