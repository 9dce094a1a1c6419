"""The workflow: what the command does, from objects and arrays, with the same numbers."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import tomllib
from pathlib import Path

import ffid
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::ffid.FfidWarning")
COMMAND = [sys.executable, "-m", "ffid"]


def run(*arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done


def test_the_numbers_are_those_of_the_command_to_the_last_digit(
    mission: ffid.Mission, record: ffid.Record, tmp_path: Path
) -> None:
    out = tmp_path / "by-command"
    run("identify", mission.file, "--record", record.name, "--held-out", "0.3", "--out", out, "--quiet")
    expected = json.loads((out / "result.json").read_text())
    result = ffid.identify(mission, record, held_out=0.3)
    result.save(tmp_path / "by-python")
    found = json.loads((tmp_path / "by-python" / "result.json").read_text())
    assert found == expected
    assert found == result.raw
    assert (tmp_path / "by-python" / "identified.toml").read_text() == (out / "identified.toml").read_text()
    assert sorted(p.name for p in (tmp_path / "by-python").iterdir()) == sorted(p.name for p in out.iterdir())


def test_arrays_give_what_the_file_gives(mission: ffid.Mission, record: ffid.Record, result: ffid.Result) -> None:
    channels = {c: getattr(record, c) for c in ("t", "q", "qd", "qdd", "tau", "gyro", "acc", "att")}
    same = ffid.Record.from_arrays(mission, **channels, name="m1")
    again = ffid.identify(mission, same)
    assert again.values == pytest.approx(result.values, rel=1e-9)
    with pytest.raises(ffid.DataError) as e:
        ffid.identify(mission, [same, same])
    assert e.value.code == "Data::SameData"


def test_the_estimates_are_the_truth(result: ffid.Result, fixtures: Path) -> None:
    truth = {p["name"]: p["value"] for p in ffid.Mission.load(fixtures / "verdict" / "truth.toml").parameters}
    for name, value in result.values.items():
        std = result.std[name]
        assert std is not None and abs(value - truth[name]) < 3 * std, name
    assert result.explains is True and result.exit_code == 0


def test_a_result_says_what_it_found(result: ffid.Result, tmp_path: Path) -> None:
    table = result.parameters
    assert list(table["name"]) == list(result.values)
    assert table["std"].gt(0).all()
    names, covariance = result.covariance_names, result.covariance
    assert covariance.shape == (len(names), len(names))
    k = names.index("tank.mass")
    assert np.sqrt(covariance[k, k]) == pytest.approx(result.std["tank.mass"])
    assert "parameters are determined" in result.verdict
    assert "tank.mass" in result._repr_html_() and "<html" in result.report()
    modes = [m["frequency_hz"] for m in result.modes]
    assert modes == sorted(modes) and len(modes) == 4
    assert result.mission.modes()[0]["frequency_hz"] == pytest.approx(modes[0])
    identified = result.mission
    assert "tank.mass" in tomllib.loads(identified.to_toml())["parameters"]
    again = ffid.Mission.load(identified.save(tmp_path))
    values = {p["name"]: p["value"] for p in again.parameters}
    assert {name: values[name] for name in result.values} == result.values
    signals = result.signals()
    assert signals["measured"].shape == (len(signals["t"]), len(signals["names"]))


def test_a_result_is_saved_loaded_and_used(
    mission: ffid.Mission, result: ffid.Result, tmp_path: Path, fixtures: Path
) -> None:
    folder = tmp_path / "identified"
    result.save(folder)
    with pytest.raises(ffid.OutputError) as e:
        result.save(folder)
    assert e.value.code == "Io::Exists"
    loaded = ffid.Result.load(folder)
    assert loaded.raw == result.raw and loaded.values == result.values and loaded.exit_code == result.exit_code
    assert [p.code for p in loaded.problems] == [w["code"] for w in result.raw["warnings"]]
    assert str(loaded) == str(result) and loaded.report() == (folder / "report.html").read_text()
    for model in (result, loaded):
        judged = model.validate(fixtures / "verdict" / "m2.parquet")
        assert judged.explained and judged.chi2_per_dof < 1.5
    with pytest.raises(ffid.DataError) as e:
        loaded.validate(fixtures / "verdict" / "m1.parquet")
    assert e.value.code == "Data::SameData"
    (folder / "result.json").write_text("{}")
    with pytest.raises(ffid.FfidError):
        ffid.Result.load(folder)


def test_a_plan_is_judged_flown_and_identified(fixtures: Path, tmp_path: Path) -> None:
    mission = ffid.Mission.load(fixtures / "paper" / "flex.toml")
    seen: list[tuple[str, int, float]] = []
    plan = ffid.plan_excitation(mission, goal="paper", progress=lambda *x: seen.append(x))
    assert plan.duration > 1 and plan.raw["goal"] == "paper" and plan.verdict.parameters
    plan.save(tmp_path / "trajectory.json")
    again = ffid.Motion.load(tmp_path / "trajectory.json", mission)
    t = np.linspace(0.0, plan.duration, 50)
    for a, b in zip(plan(t), again(t)):
        assert np.array_equal(a, b) and a.shape == (50, 7)
    assert ffid.preflight(mission, again).raw == plan.verdict.raw
    exact = mission.simulate(plan, noise_free=True)
    noisy = mission.simulate(plan, seed=3)
    assert exact.qdd is not None and noisy.qdd is None
    assert np.array_equal(mission.simulate(plan, seed=3).tau, noisy.tau)
    run("simulate", mission.file, "--trajectory", tmp_path / "trajectory.json", "--seed", 3, "--out", tmp_path / "r.csv")
    from_file = ffid.Record.read(tmp_path / "r.csv", mission)
    assert np.array_equal(from_file.tau, noisy.tau) and np.array_equal(from_file.gyro, noisy.gyro)
    q = plan(np.arange(0, plan.duration, 0.02))[0]
    through = mission.simulate(np.arange(len(q)) * 0.02, q, noise_free=True)
    n = min(len(through), len(exact))
    assert np.abs(through.q[:n] - exact.q[:n]).max() < 1e-3


def test_predictions_are_those_of_the_command(result: ffid.Result, mission: ffid.Mission, tmp_path: Path) -> None:
    t = np.linspace(0, 10, 501)
    q0 = mission.model.neutral()[0, 7 : 7 + len(mission.joints)]
    q = q0 + 0.1 * (1 - np.cos(2 * np.pi * t / 10))[:, None] ** 2
    motion = ffid.Motion.from_arrays(mission, t=t, q=q)
    predicted = result.predict(motion, hold=2.0)
    assert predicted.t[-1] == pytest.approx(12.0)
    header = ",".join(["time[s]", *(f"q.{j}[rad]" for j in mission.joints)])
    rows = [",".join(map(repr, row)) for row in np.column_stack([t, q]).tolist()]
    (tmp_path / "t.csv").write_text("\n".join([header, *rows, ""]))
    result.save(tmp_path / "m")
    run("predict", tmp_path / "m", "--trajectory", tmp_path / "t.csv", "--hold", 2, "--out", tmp_path / "p.csv")
    assert np.array_equal(ffid.Record.read(tmp_path / "p.csv", mission).tau, predicted.tau)


def test_missions_begin_with_a_robot(fixtures: Path, tmp_path: Path) -> None:
    urdf = fixtures / "verdict" / "robot.urdf"
    started = ffid.Mission.from_urdf(urdf, rate_hz=50.0, torque_noise=0.1, gyro_noise=1e-4, out=tmp_path / "m.toml")
    assert tomllib.loads(started.to_toml())["sensors"]["rate_hz"] == 50.0
    assert ffid.Mission.load(started.save(tmp_path / "copy")).parameters == started.parameters
    assert started.check()["name"] == started.model.name
    assert ffid.Mission.from_urdf(urdf).joints == started.joints
    with pytest.raises(ffid.OutputError):
        ffid.Mission.from_urdf(urdf, out=tmp_path / "m.toml")
    with pytest.raises(ffid.ConfigError) as e:
        ffid.Mission.from_urdf(urdf, stiffness={"no_such_hinge": 3.0})
    assert e.value.code == "Config::UnknownJoint" and e.value.next_step


def test_errors_carry_their_problems(fixtures: Path, tmp_path: Path) -> None:
    text = (fixtures / "paper" / "flex.toml").read_text().replace("rate_hz", "rate_hz = -0.7 #", 1)
    (tmp_path / "robot.urdf").write_bytes((fixtures / "paper" / "robot.urdf").read_bytes())
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(ffid.ConfigError) as e:
        ffid.Mission.load(tmp_path / "bad.toml")
    p = e.value.first
    assert (p.code, p.value, p.unit, p.limit) == ("Config::OutOfRange", -0.7, "Hz", {"above": 0.0})
    assert "bad.toml" in p.place and "rate_hz" in p.place and p.line and p.next_step
    assert (e.value.code, e.value.value, e.value.exit_code) == (p.code, p.value, 11)
    assert pickle.loads(pickle.dumps(e.value)).problems == e.value.problems
    with pytest.raises(ffid.OutputError) as missing:
        ffid.Mission.load(tmp_path / "none.toml")
    assert missing.value.exit_code == 20 and missing.value.code == "Io::Read"


def test_warnings_are_warnings_and_can_be_errors(mission: ffid.Mission, record: ffid.Record) -> None:
    far = record.q + 40.0
    with pytest.warns(ffid.FfidWarning) as caught:
        ffid.Record.from_arrays(mission, t=record.t, q=far, tau=record.tau, gyro=record.gyro)
    problems = [w.message.problem for w in caught if isinstance(w.message, ffid.FfidWarning)]
    assert {p.code for p in problems} <= {"Data::BeyondLimits", "Data::LooksLikeDegrees"}
    assert problems[0].object == f"q.{mission.joints[0]}"


def test_an_exception_in_progress_ends_the_fit(mission: ffid.Mission, record: ffid.Record) -> None:
    calls = []

    def stop(what: str, n: int, cost: float) -> None:
        calls.append((what, n, cost))
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        ffid.identify(mission, record, progress=stop)
    assert len(calls) == 1 and calls[0][0] == "fit"


def test_ctrl_c_ends_a_fit(mission: ffid.Mission, record: ffid.Record) -> None:
    def interrupt(what: str, n: int, cost: float) -> None:
        if n == 2:
            os.kill(os.getpid(), signal.SIGINT)

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        ffid.identify(mission, record, starts=50, progress=interrupt)
    assert time.monotonic() - begun < 20


def test_fits_in_threads_run_side_by_side(mission: ffid.Mission, record: ffid.Record, result: ffid.Result) -> None:
    found: list[ffid.Result] = []
    ticks = 0

    def fit() -> None:
        found.append(ffid.identify(mission, record))

    threads = [threading.Thread(target=fit) for _ in range(2)]
    [t.start() for t in threads]
    while any(t.is_alive() for t in threads):
        ticks += 1
        time.sleep(0.005)
    assert [f.raw["parameters"] for f in found] == 2 * [result.raw["parameters"]]
    # This thread went on meanwhile.
    assert ticks > 5


def test_records_from_data_frames(mission: ffid.Mission, record: ffid.Record) -> None:
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    gyro = record.gyro
    assert gyro is not None
    columns = {"time[s]": record.t}
    columns |= {f"q.{j}[rad]": record.q[:, i] for i, j in enumerate(mission.joints)}
    columns |= {f"tau.{j}": record.tau[:, i] for i, j in enumerate(mission.joints)}
    columns |= {f"gyro.{c}": gyro[:, i] for i, c in enumerate("xyz")}
    for made in (
        ffid.Record.from_pandas(mission, pandas.DataFrame(columns)),
        ffid.Record.from_polars(mission, polars.DataFrame(columns)),
    ):
        assert np.array_equal(made.q, record.q) and np.array_equal(made.gyro, gyro)
    wrong = dict(columns)
    wrong["gyro.x[deg/s]"] = wrong.pop("gyro.x")
    with pytest.raises(ValueError, match="deg/s"):
        ffid.Record.from_pandas(mission, pandas.DataFrame(wrong))
    del columns[f"tau.{mission.joints[0]}"]
    with pytest.raises(ValueError, match=f"tau.{mission.joints[0]}"):
        ffid.Record.from_polars(mission, polars.DataFrame(columns))


def test_the_wheel_brings_the_command() -> None:
    assert run("--version").stdout == f"ffid {ffid.__version__}\n"
    assert "error" in run("identify", code=2).stderr
    script = Path(sys.executable).parent / "ffid"
    assert subprocess.run([script, "--version"], capture_output=True, text=True, check=True).stdout.startswith("ffid ")


def test_memory_does_not_grow(mission: ffid.Mission, record: ffid.Record) -> None:
    import resource

    short = ffid.Record.from_arrays(
        mission, t=record.t[:300], q=record.q[:300], tau=record.tau[:300], gyro=record.gyro[:300], name="short"  # type: ignore[index]
    )

    def fits(n: int) -> int:
        for _ in range(n):
            ffid.identify(mission, short, max_iterations=1, clocks="trust")
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    first = fits(5)
    assert fits(15) - first < 20_000  # kB
