"""The workflow: what the command does, from objects and arrays, with the same numbers."""

from __future__ import annotations

import json
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import tomllib
import warnings
from pathlib import Path
from typing import Any

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


def test_the_log_has_beginning_end_and_every_step(
    mission: ffid.Mission, record: ffid.Record, result: ffid.Result, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[tuple[str, int, float]] = []
    with caplog.at_level(logging.DEBUG, logger="ffid"):
        again = ffid.identify(mission, record, progress=lambda *x: seen.append(x))
    lines = [(r.levelname, r.getMessage()) for r in caplog.records if r.name == "ffid"]
    assert lines[0] == ("INFO", f"identify: {mission.file}, {record.name}")
    assert lines[1:-1] == [("DEBUG", f"{what}: step {n}, {cost:.6g}") for what, n, cost in seen] and len(seen) > 5
    assert lines[-1] == ("INFO", f"identify: exit code 0; {again.verdict}")
    assert again.values == result.values


def test_ctrl_c_ends_a_fit_and_keeps_what_it_has(mission: ffid.Mission, record: ffid.Record, result: ffid.Result) -> None:
    def interrupt(what: str, n: int, cost: float) -> None:
        # The first ones are over a thinned record.
        if n == 40:
            os.kill(os.getpid(), signal.SIGINT)

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt) as e:
        ffid.identify(mission, record, starts=50, progress=interrupt)
    assert time.monotonic() - begun < 60
    kept = e.value
    assert isinstance(kept, ffid.Interrupted) and kept.result is None and kept.mission is not None
    assert list(kept.values) == list(result.values) and kept.linearisations >= 40
    assert kept.values["base.mass"] != mission.model.parameter_values[mission.model.parameter_names.index("base.mass")]
    # A fit goes on from there, to the same end.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        again = ffid.identify(kept.mission, record)
    for name, value in result.values.items():
        std = result.std[name]
        assert std is not None and abs(again.values[name] - value) < 0.1 * std, name


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


def columns_of(mission: ffid.Mission, record: ffid.Record) -> dict[str, Any]:
    gyro = record.gyro
    assert gyro is not None
    columns = {"time[s]": record.t}
    columns |= {f"q.{j}[rad]": record.q[:, i] for i, j in enumerate(mission.joints)}
    columns |= {f"tau.{j}": record.tau[:, i] for i, j in enumerate(mission.joints)}
    return columns | {f"gyro.{c}": gyro[:, i] for i, c in enumerate("xyz")}


def test_records_from_data_frames(mission: ffid.Mission, record: ffid.Record) -> None:
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    columns = columns_of(mission, record)
    noted = columns | {"mode": ["a"] * len(record), "temperature": np.full(len(record), 20.0)}
    for made in (
        ffid.Record.from_pandas(mission, pandas.DataFrame(noted)),
        ffid.Record.from_polars(mission, polars.DataFrame(noted)),
    ):
        assert np.array_equal(made.q, record.q) and np.array_equal(made.gyro, record.gyro)
    # Other units, a time index, torques at half the rate.
    other = {k: v for k, v in columns.items() if k != "time[s]"}
    other["gyro.x[deg/s]"] = np.degrees(other.pop("gyro.x"))
    frame = pandas.DataFrame(other)
    frame.index = pandas.Timestamp("2026-03-04T05:06:07.123456789") + pandas.to_timedelta(np.round(1e9 * record.t), unit="ns")
    frame.loc[frame.index[1::2], [f"tau.{j}" for j in mission.joints]] = np.nan
    made = ffid.Record.from_pandas(mission, frame)
    assert made.gyro is not None and np.allclose(made.gyro, record.gyro, rtol=1e-14)
    assert len(made.times("tau")) == (len(record) + 1) // 2 and np.array_equal(made.tau, record.tau[::2])
    assert np.allclose(made.t - made.t[0], record.t - record.t[0], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda c: c.update({"gyro.x[furlong]": c.pop("gyro.x")}), "Data::UnknownUnit"),
        (lambda c: c.pop("tau.elbow"), "Data::Columns"),
        (lambda c: c["q.elbow[rad]"].__setitem__(7, np.nan), "Data::NotFinite"),
        (lambda c: c.update({"tau.elbow": c["tau.elbow"].astype(str)}), "Array::Type"),
        (lambda c: c.pop("time[s]"), "Data::Columns"),
    ],
)
def test_data_frames_that_are_no_record(mission: ffid.Mission, record: ffid.Record, change: Any, code: str) -> None:
    polars = pytest.importorskip("polars")
    columns = {k: v.copy() for k, v in columns_of(mission, record).items()}
    change(columns)
    with pytest.raises(ffid.DataError) as e:
        ffid.Record.from_polars(mission, polars.DataFrame(columns))
    assert code in [p.code for p in e.value.problems], e.value
    assert e.value.next_step


def test_nothing_is_printed(mission: ffid.Mission, record: ffid.Record, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    result = ffid.identify(mission, record, held_out=0.3)
    result.save(tmp_path / "quiet")
    ffid.doctor(mission, record)
    mission.check(), mission.modes(), mission.show(), str(result), result.report()
    assert capfd.readouterr() == ("", "")


def test_the_doctor_sees_what_is_wrong(mission: ffid.Mission, record: ffid.Record, fixtures: Path) -> None:
    good = ffid.doctor(mission, [record, fixtures / "verdict" / "m2.parquet"], torque_noise=0.06)
    assert good.judgement != "wrong" and good.exit_code == 0 and set(good.findings["topic"]) >= {"units", "noise", "clocks"}
    printed = run("doctor", mission.file, "--record", record.name, "--json")
    assert ffid.doctor(mission, record).raw == json.loads(printed.stdout)["diagnosis"]
    tau = record.tau.copy()
    tau[:, 2] *= -1.0
    wrong = ffid.Record.from_arrays(mission, t=record.t, q=record.q, tau=tau, gyro=record.gyro, name="turned")
    found = ffid.doctor(mission, wrong)
    assert (found.judgement, found.exit_code) == ("wrong", 12)
    assert [p.code for p in found.problems if p.severity == "error"] == ["Data::AxisMismatch"]
    assert mission.joints[2] in str(found) and "wrong" in found._repr_html_()
    with pytest.raises(ffid.DataError) as e:
        ffid.identify(mission, wrong)
    assert e.value.code == "Data::AxisMismatch"


def test_a_record_with_a_gap_is_judged_as_by_the_command(result: ffid.Result, mission: ffid.Mission, fixtures: Path, tmp_path: Path) -> None:
    other = ffid.Record.read(fixtures / "verdict" / "m2.parquet", mission)
    keep = (other.t < 20.0) | (other.t > 23.0)
    columns = {k: v[keep] for k, v in columns_of(mission, other).items()}
    header = ",".join(k if "[" in k else f"{k}[{'N m' if k.startswith('tau') else 'rad/s'}]" for k in columns)
    rows = [",".join(map(repr, row)) for row in np.column_stack(list(columns.values())).tolist()]
    (tmp_path / "gap.csv").write_text("\n".join([header, *rows, ""]))
    result.save(tmp_path / "m")
    judged = result.validate(tmp_path / "gap.csv")
    by_command = json.loads(run("validate", tmp_path / "m", "--record", tmp_path / "gap.csv", "--json").stdout)["verdict"]
    assert judged.raw == by_command
    # The part behind the gap begins in the middle of the motion, which is no contradiction.
    assert judged.explained and judged.exit_code == 0 and judged.raw["seconds"] < 40.0


def test_a_record_of_another_robot_is_not_explained(result: ffid.Result, mission: ffid.Mission, record: ffid.Record) -> None:
    other = mission.with_values({"tank.mass": 3.0 * result.values["tank.mass"], "wing.k[0]": 0.4 * result.values["wing.k[0]"]})
    t = np.linspace(0.0, 30.0, 301)
    q = record.q[0] + 0.3 * np.sin(2 * np.pi * t / 7.5)[:, None] ** 2 * np.linspace(1.0, 2.0, len(mission.joints))
    judged = result.validate(other.simulate(t, q, hold=10.0, seed=4))
    assert not judged.explained and judged.exit_code == 16
    assert judged.problems[-1].code == "Fit::NotExplained"


def test_signals_of_a_result_that_was_loaded(mission: ffid.Mission, record: ffid.Record, tmp_path: Path) -> None:
    result = ffid.identify(mission, record, held_out=0.3)
    result.save(tmp_path / "r")
    loaded = ffid.Result.load(tmp_path / "r")
    for own, again in ((result.signals(), loaded.signals()), (result.held_out_signals(), loaded.held_out_signals())):
        assert own["names"] == again["names"] and list(own["units"]) == again["units"]
        for key in ("t", "measured", "predicted", "sigma"):
            assert np.allclose(own[key], again[key], rtol=1e-14, atol=0), key
    for r in (result, loaded):
        with pytest.raises(LookupError):
            r.signals(1)
    loaded.save(tmp_path / "copy")
    assert ffid.Result.load(tmp_path / "copy").raw == loaded.raw


def test_values_and_what_is_uncertain_can_be_changed(mission: ffid.Mission, fixtures: Path) -> None:
    heavy = mission.with_values({"tank.mass": 77.7})
    assert {p["name"]: p["value"] for p in heavy.parameters}["tank.mass"] == 77.7
    assert tomllib.loads(heavy.to_toml())["parameters"]["tank.mass"] == 77.7
    with pytest.raises(KeyError, match=r"tank\.mass"):
        mission.with_values({"tank.mas": 1.0})
    tables = [{"parameters": ["tank.length"], "relative_std": 0.1}, {"sensor": "torque", "gain_relative_std": 0.02}]
    unsure = mission.with_uncertain(tables)
    said = tomllib.loads(unsure.to_toml())
    assert said["uncertain"] == tables[:1] and said["sensors"]["torque"]["gain_relative_std"] == 0.02
    assert unsure.parameters == mission.parameters
    again = unsure.with_uncertain([])
    assert "uncertain" not in tomllib.loads(again.to_toml())
    text = mission.to_toml().replace("rate_hz", "rate_hz = 25.0 #", 1)
    slow = ffid.Mission.from_toml(text, folder=mission.file.parent)
    assert slow.joints == mission.joints and tomllib.loads(slow.to_toml())["sensors"]["rate_hz"] == 25.0
    with pytest.raises(ffid.ConfigError) as e:
        ffid.Mission.from_toml(text.replace("rate_hz", "rate_hs", 1), folder=mission.file.parent)
    assert e.value.first.line == 1 + text[: text.index("rate_hz")].count("\n")


def test_uncertain_items_are_estimated_considered_or_left_out(mission: ffid.Mission, record: ffid.Record) -> None:
    tables = [{"mounts": ["tank"], "position_std_m": 0.01}]
    exact = ffid.identify(mission, record, uncertain="exact")
    beside = ffid.identify(mission, record, uncertain=tables)
    held = ffid.identify(mission.with_uncertain(tables), record, uncertain="consider")
    assert not exact.raw.get("budget") and len(beside.budget) == len(beside.values)
    for name in exact.values:
        a, b, c = exact.std[name], beside.std[name], held.std[name]
        assert a is not None and b is not None and c is not None
        assert b >= a * (1 - 1e-6) and c >= b * (1 - 1e-3), name


def test_draws_are_those_of_the_posterior(mission: ffid.Mission, record: ffid.Record, tmp_path: Path) -> None:
    gyro = record.gyro
    assert gyro is not None
    # A third of the samples: draws take hundreds of evaluations.
    thin = ffid.Record.from_arrays(mission, t=record.t[::3], q=record.q[::3], tau=record.tau[::3], gyro=gyro[::3], name="thin")
    result = ffid.identify(mission, thin, sample=60)
    draws = result.draws
    assert draws is not None and draws.values.shape[0] == 4 and len(draws.names) == draws.values.shape[2]
    for name, value in result.values.items():
        std = result.std[name]
        assert std is not None and abs(draws[name].mean() - value) < std and 0.5 * std < draws[name].std() < 2 * std, name
    result.save(tmp_path / "drawn")
    loaded = ffid.Result.load(tmp_path / "drawn")
    again = loaded.draws
    assert again is not None and again.names == draws.names and again.units == draws.units
    assert np.array_equal(again.values, draws.values) and np.array_equal(again.log_density, draws.log_density)
    name = "tank.mass"
    centre, std = draws[name].mean(), draws[name].std()
    # Two Gaussian densities of one width: half the variance, the mean between.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ffid.FfidWarning)
        narrow = draws.reweight(lambda p: -0.5 * ((p[name] - centre - std) / std) ** 2)
    row = narrow.parameters.set_index("name").loc[name]
    assert row["mean"] == pytest.approx(centre + 0.5 * std, abs=0.2 * std) and row["std"] == pytest.approx(std / 2**0.5, rel=0.25)
    assert narrow.weights.sum() == pytest.approx(1.0) and narrow.effective < len(draws)
    flat = draws.reweight(lambda p: 3.0)
    assert flat.effective == pytest.approx(len(draws)) and flat.pareto_k is None
    with pytest.warns(ffid.FfidWarning, match="tail of the weights"):
        assert not draws.reweight(lambda p: -0.5 * ((p[name] - centre - 8 * std) / (0.1 * std)) ** 2).reliable
    with pytest.raises(ValueError, match="excludes all draws"):
        draws.reweight(lambda p: float("-inf"))
    pytest.importorskip("arviz")
    data = loaded.to_arviz()
    assert np.array_equal(data["posterior"][name].values, draws[name]) and data["posterior"][name].attrs["units"] == "kg"
    with pytest.raises(LookupError, match="sample=400"):
        ffid.identify(mission, thin).to_arviz()


def test_motions_of_a_function(mission: ffid.Mission) -> None:
    n = len(mission.joints)
    reach = np.linspace(0.2, 0.4, n)

    def f(t: float) -> Any:
        return mission.model.neutral()[0, 7 : 7 + n] + reach * np.sin(0.4 * t) ** 2

    motion = ffid.Motion.from_function(mission, f, 20.0)
    t = np.linspace(0.5, 19.5, 77)
    q, qd, qdd = motion(t)
    assert motion.duration == pytest.approx(20.0)
    assert np.abs(q - np.array([f(x) for x in t])).max() < 1e-9
    assert np.abs(qd - 0.4 * reach * np.sin(0.8 * t)[:, None]).max() < 1e-6
    assert np.abs(qdd - 0.32 * reach * np.cos(0.8 * t)[:, None]).max() < 1e-4
    assert len(mission.simulate(motion)) == 1 + 20 * 50
    with pytest.raises(ValueError, match=rf"\({n},\) is needed"):
        ffid.Motion.from_function(mission, lambda t: [0.0], 1.0)
    with pytest.raises(ZeroDivisionError):
        ffid.Motion.from_function(mission, lambda t: [1 / 0] * n, 1.0)
    page = mission.show(motion, hold=1.0)
    assert page.startswith("<!") and "<iframe" in page._repr_html_()


def test_a_cost_chooses_among_plans(fixtures: Path) -> None:
    mission = ffid.Mission.load(fixtures / "paper" / "flex.toml")
    seen: list[tuple[float, ffid.Plan]] = []

    def longest_reach(plan: ffid.Plan) -> float:
        seen.append((float(np.ptp(plan(np.linspace(0, plan.duration, 100))[0][:, 0])), plan))
        return seen[-1][0]

    plan = ffid.plan_excitation(mission, goal="paper", cost=longest_reach, candidates=3)
    assert len(seen) == 3 and plan is min(seen, key=lambda x: x[0])[1]
    with pytest.raises(ValueError, match="candidates"):
        ffid.plan_excitation(mission, goal="paper", candidates=3)


def test_files_are_converted_and_described(mission: ffid.Mission, record: ffid.Record, tmp_path: Path) -> None:
    ffid.convert(record.name, tmp_path / "m1.csv", si=True)
    assert np.array_equal(ffid.Record.read(tmp_path / "m1.csv", mission).tau, record.tau)
    with pytest.raises(ffid.OutputError):
        ffid.convert(record.name, tmp_path / "m1.csv")
    lines = (tmp_path / "m1.csv").read_text().splitlines()
    for name, gyro in ("arm.csv", False), ("gyro.csv", True):
        of = [i for i, c in enumerate(lines[0].split(",")) if i == 0 or c.startswith("gyro") == gyro]
        rows = [",".join(line.split(",")[i] for i in of) for line in lines]
        (tmp_path / name).write_text("\n".join(rows) + "\n")
    ffid.convert(tmp_path / "arm.csv", tmp_path / "both.csv", with_=[tmp_path / "gyro.csv"])
    both = ffid.Record.read(tmp_path / "both.csv", mission)
    assert np.array_equal(both.tau, record.tau) and np.array_equal(both.gyro, record.gyro)
    assert "properties" in ffid.schema("mission") and "properties" in ffid.schema("result")
    with pytest.raises(ValueError, match="nothing"):
        ffid.schema("nothing")  # type: ignore[arg-type]
    assert mission.selfcheck()


def test_the_example_of_the_command_line_has_the_same_numbers(tmp_path: Path) -> None:
    """docs/examples/three-segment, from URDF to result, by command and by Python."""
    folder = Path(__file__).resolve().parents[3] / "docs" / "examples" / "three-segment"
    m = tmp_path / "m.toml"
    how = ["--stiffness", 220, "--damping", 1.5, "--tank", "58,0.55,12,2", "--tank-at=-0.25,0.18,0.35", "--rate-hz", 50]
    run("init", folder / "robot.urdf", "-o", m, *how, "--torque-noise", 0.05, "--gyro-noise", 1e-4)
    run("identify", m, "--record", folder / "record.csv", "--held-out", 0.3, "--out", tmp_path / "r", "--quiet")
    mission = ffid.Mission.from_urdf(
        folder / "robot.urdf",
        stiffness=220,
        damping=1.5,
        tank=(58, 0.55, 12, 2),
        tank_at=(-0.25, 0.18, 0.35),
        rate_hz=50,
        torque_noise=0.05,
        gyro_noise=1e-4,
    )
    result = ffid.identify(mission, folder / "record.csv", held_out=0.3)
    expected = json.loads((tmp_path / "r" / "result.json").read_text())
    for key in ("parameters", "nuisance", "covariance", "modes", "held_out", "evidence"):
        assert result.raw[key] == expected[key], key


def test_the_wheel_brings_the_command() -> None:
    assert run("--version").stdout == f"ffid {ffid.__version__}\n"
    assert "error" in run("identify", code=2).stderr
    script = Path(sys.executable).parent / "ffid"
    assert subprocess.run([script, "--version"], capture_output=True, text=True, check=True).stdout.startswith("ffid ")


def test_importing_is_quick_and_light() -> None:
    code = "import sys, time; import numpy; t = time.perf_counter(); import ffid; print(time.perf_counter() - t); print(*sys.modules)"
    seconds, modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
    assert not {"pandas", "polars", "matplotlib", "arviz", "scipy"} & set(modules.split())
    # Beside NumPy; generous, as the machine may be busy.
    assert float(seconds) < 2.0


def test_memory_does_not_grow(mission: ffid.Mission, record: ffid.Record) -> None:
    import resource

    gyro = record.gyro
    assert gyro is not None
    short = ffid.Record.from_arrays(
        mission, t=record.t[:300], q=record.q[:300], tau=record.tau[:300], gyro=gyro[:300], name="short"
    )

    def fits(n: int) -> int:
        for _ in range(n):
            ffid.identify(mission, short, max_iterations=1, clocks="trust")
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    # FFID_FITS=1000 is the whole of it.
    first = fits(5)
    assert fits(int(os.environ.get("FFID_FITS", "15"))) - first < 20_000  # kB


def test_a_payload_is_told_from_logs_with_and_without_it(fixtures: Path, tmp_path: Path) -> None:
    """``without`` is ``--without``, of records in memory or files."""
    payload = """
[[client]]
name = "load"
host = "arm_l7"
mass_kg = {mass}
com_m = [0.03, -0.02, 0.06]
inertia_com_kgm2 = [0.012, 0.001, -0.002, 0.014, 0.001, 0.011]
"""
    text = (fixtures / "ground" / "arm.toml").read_text().replace('["arm_l*"]', '["arm_l*", "load.*"]')
    load = {what: ffid.Mission.from_toml(text + payload.format(mass=m), folder=fixtures / "ground") for what, m in (("guess", 2.0), ("truth", 2.7))}
    bare = ffid.Mission.from_toml(text.replace(', "load.*"', ""), folder=fixtures / "ground")
    n = len(bare.joints)
    t = np.arange(0, 16, 0.004)
    rng = np.random.default_rng(11)

    def log(mission: ffid.Mission, name: str, seed: int) -> ffid.Record:
        phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (4, n))
        o = 2 * np.pi * np.array([0.09, 0.17, 0.31, 0.47])[:, None, None]
        arg = o * t[None, :, None] + phases[:, None, :]
        size = 0.35
        q, v, a = size * np.sin(arg).sum(0), size * (o * np.cos(arg)).sum(0), -size * (o**2 * np.sin(arg)).sum(0)
        tau = mission.model.rnea(q, v, a) + rng.normal(0, 0.02, q.shape)
        return ffid.Record.from_arrays(mission, t=t, q=q, tau=tau, name=name)

    empty, loaded = log(bare, "empty", 5), log(load["truth"], "loaded", 6)
    result = ffid.identify(load["guess"], [empty, loaded], without={"load": empty}, truth=load["truth"])
    assert result.values["load.body.mass"] == pytest.approx(2.7, rel=0.02)
    assert result.raw["parameters"][0]["truth"] > 0 and "truth" in result.parameters
    wrong = ffid.identify(load["guess"], [empty, loaded])
    assert abs(wrong.values["load.body.mass"] - 2.7) > 0.3, "without= is what tells them"
    with pytest.raises(ValueError, match="none of those"):
        ffid.identify(load["guess"], [loaded], without={"load": empty})
    with pytest.raises(ffid.FfidError):
        ffid.identify(load["guess"], [empty, loaded], without={"hand": empty})


def test_the_descent_ends_at_the_estimates(result: ffid.Result, fixtures: Path) -> None:
    descent = result.raw["descent"]
    assert len(descent) > 2 and descent[0]["cost"] > descent[-1]["cost"]
    assert descent[-1]["residuals"] == result.raw["residuals"] == max(s["residuals"] for s in descent)
    whole = [s["cost"] for s in descent if s["residuals"] == result.raw["residuals"]]
    assert whole == sorted(whole, reverse=True)
