"""Bad arrays: each is refused with an exception that says what is wrong with which one."""

from __future__ import annotations

import threading
from typing import Any

import ffid
import numpy as np
import pytest


@pytest.fixture(scope="module")
def model(mission: ffid.Mission) -> ffid.Model:
    return mission.model


def states(model: ffid.Model, rows: int = 9) -> tuple[Any, Any, Any]:
    r = np.random.default_rng(3)
    return model.neutral(rows), r.normal(size=(rows, model.nv)), r.normal(size=(rows, model.nv))


def broken(kind: str, x: Any) -> Any:
    if kind == "shape":
        return x[:, :-1]
    if kind == "rows":
        return x[:-1]
    if kind == "dimension":
        return x[0]
    if kind == "empty":
        return x[:0]
    if kind == "object":
        return x.astype(object)
    if kind == "complex":
        return x.astype(complex)
    if kind == "text":
        return x.astype(str)
    if kind == "ragged":
        return [[1.0, 2.0], [3.0]]
    if kind == "nothing":
        return None
    y = x.copy()
    y[4, 2] = {"nan": np.nan, "infinite": -np.inf}[kind]
    return y


@pytest.mark.parametrize("argument", ["q", "v", "a"])
@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("shape", "Array::Shape"),
        ("rows", "Array::Shape"),
        ("dimension", "Array::Shape"),
        ("empty", "Array::"),
        ("object", "Array::Type"),
        ("complex", "Array::Type"),
        ("text", "Array::Type"),
        ("ragged", "Array::Type"),
        ("nothing", "Array::Type"),
        ("nan", "Array::NotFinite"),
        ("infinite", "Array::NotFinite"),
    ],
)
def test_what_is_wrong_with_an_argument(model: ffid.Model, argument: str, kind: str, code: str) -> None:
    given = dict(zip("qva", states(model)))
    given[argument] = broken(kind, given[argument])
    with pytest.raises(ffid.ArrayError) as e:
        model.rnea(**given)
    # Without one of its rows q is right, and those after it are wrong.
    named = "v" if (argument, kind) == ("q", "rows") else argument
    assert e.value.code.startswith(code)
    assert e.value.first.object == named
    assert e.value.next_step
    if kind in ("nan", "infinite"):
        assert "(4, 2)" in str(e.value)


def test_attitudes_must_have_unit_norm(model: ffid.Model) -> None:
    q, v, a = states(model)
    q[5, 3:7] *= 1.01
    with pytest.raises(ffid.ArrayError) as e:
        model.rnea(q, v, a)
    assert (e.value.code, e.value.first.object) == ("Array::Attitude", "q")
    assert "row 5" in str(e.value)


def test_results_go_where_they_are_wanted_or_nowhere(model: ffid.Model) -> None:
    q, v, a = states(model)
    expected = model.rnea(q, v, a)
    out = np.full_like(expected, 7.3)
    assert model.rnea(q, v, a, out=out) is out or np.shares_memory(model.rnea(q, v, a, out=out), out)
    assert np.array_equal(out, expected)
    frozen = np.zeros_like(expected)
    frozen.flags.writeable = False
    wrong: list[tuple[Any, str]] = [
        (frozen, "Array::ReadOnly"),
        (np.zeros((expected.shape[0], 2 * model.nv))[:, ::2], "Array::Layout"),
        (np.asfortranarray(np.zeros_like(expected)), "Array::Layout"),
        (np.zeros((3, model.nv)), "Array::Shape"),
        (np.zeros(expected.shape, dtype=np.float32), "Array::Type"),
        ([[0.0]], "Array::Type"),
        (v, "Array::Overlap"),
    ]
    for given, code in wrong:
        before = v.copy()
        with pytest.raises(ffid.ArrayError) as e:
            model.rnea(q, v, a, out=given)
        assert (e.value.code, e.value.first.object) == (code, "out")
        assert np.array_equal(v, before)


def test_other_layouts_and_number_types_are_taken(model: ffid.Model) -> None:
    q, v, a = states(model)
    expected = model.rnea(q, v, a)
    doubled = np.repeat(v, 2, axis=1)[:, ::2]
    assert not doubled.flags.c_contiguous
    assert np.array_equal(model.rnea(np.asfortranarray(q), doubled, a.tolist()), expected)
    assert np.array_equal(model.rnea(q, v, np.ones_like(a, dtype=np.int32)), model.rnea(q, v, np.ones_like(a)))
    assert np.array_equal(model.rnea(q[::-1], v[::-1], a[::-1]), expected[::-1])


def test_what_is_too_large_is_refused_before_it_is_made(model: ffid.Model) -> None:
    q = np.broadcast_to(model.neutral()[0], (1 << 40, model.nq))
    with pytest.raises(ffid.ArrayError) as e:
        model.mass_matrix(q)
    assert (e.value.code, e.value.first.object) == ("Array::TooLarge", "q")


@pytest.mark.parametrize(
    ("change", "code", "place"),
    [
        (lambda x: x.update(t=x["t"][::-1]), "Data::NonMonotone", None),
        (lambda x: x.update(t=1e9 * x["t"]), "Data::TimeScale", None),
        (lambda x: x.update(t=x["t"][:-1]), "Array::Shape", "q"),
        (lambda x: x.update(q=x["q"][:, 1:]), "Array::Shape", "q"),
        (lambda x: x.update(tau=x["tau"].astype(object)), "Array::Type", "tau"),
        (lambda x: x.update(gyro=np.full_like(x["gyro"], np.nan)), "Array::NotFinite", "gyro"),
        (lambda x: x.update(gyro=None), "Data::Missing", None),
        (lambda x: x.update(q=None), "Array::Type", "q"),
        (lambda x: x.update(tau=np.zeros_like(x["tau"])), "Data::Stuck", None),
    ],
)
def test_records_that_cannot_be(
    mission: ffid.Mission, record: ffid.Record, change: Any, code: str, place: str | None
) -> None:
    arrays = {"t": record.t, "q": record.q, "tau": record.tau, "gyro": record.gyro}
    change(arrays)
    with pytest.raises(ffid.DataError) as e:
        ffid.Record.from_arrays(mission, **arrays)
    assert code in [p.code for p in e.value.problems]
    if place:
        assert e.value.first.object == place


def test_arrays_in_use_by_another_thread_are_not_written(model: ffid.Model) -> None:
    q, v, a = states(model, 20_000)
    shape = (len(q), model.nv, len(model.parameter_names))
    y = np.zeros(shape)
    failed = []

    def fill() -> None:
        try:
            model.regressor(q, v, a, out=y, threads=1)
        except ffid.ArrayError as e:
            failed.append(e.code)

    threads = [threading.Thread(target=fill) for _ in range(2)]
    [t.start() for t in threads]
    [t.join() for t in threads]
    assert failed in ([], ["Array::Overlap"])
    assert np.array_equal(y[-5:], model.regressor(q[-5:], v[-5:], a[-5:])) or np.allclose(
        y[-5:], model.regressor(q[-5:], v[-5:], a[-5:]), rtol=1e-12
    )


def test_channels_at_times_of_their_own(mission: ffid.Mission, record: ffid.Record) -> None:
    gyro = record.gyro
    assert gyro is not None and record.uniform
    half = ffid.Record.from_arrays(
        mission, t=record.t, q=record.q, tau=record.tau[::2], t_tau=record.t[::2], gyro=gyro[1:-1], t_gyro=record.t[1:-1]
    )
    assert not half.uniform and np.array_equal(half.t, record.t)
    assert np.allclose(half.times("tau"), record.t[::2], rtol=0, atol=1e-12)
    assert half.tau.shape == record.tau[::2].shape and np.array_equal(half.tau, record.tau[::2])
    with pytest.raises(ffid.ArrayError) as e:
        ffid.Record.from_arrays(mission, t=record.t, q=record.q, tau=record.tau, t_tau=record.t[::2], gyro=gyro)
    assert (e.value.code, e.value.first.object) == ("Array::Shape", "tau")


@pytest.mark.filterwarnings("ignore::ffid.FfidWarning")
def test_samples_that_were_lost_count_at_their_times(mission: ffid.Mission, record: ffid.Record) -> None:
    keep = np.ones(len(record.t), dtype=bool)
    keep[np.random.default_rng(2).choice(np.arange(5, len(keep) - 5), 60, replace=False)] = False
    gyro = record.gyro
    assert gyro is not None
    lost = ffid.Record.from_arrays(mission, t=record.t[keep], q=record.q[keep], tau=record.tau[keep], gyro=gyro[keep])
    assert np.allclose(lost.t, record.t[keep], rtol=0, atol=1e-9) and lost.q.shape == (keep.sum(), len(mission.joints))


def test_threads_below_zero_are_refused(model: ffid.Model) -> None:
    with pytest.raises(ValueError, match="threads is -1"):
        model.mass_matrix(model.neutral(), threads=-1)


def test_what_is_no_mission_and_no_record_says_what_is_needed(mission: ffid.Mission, record: ffid.Record) -> None:
    for call in (
        lambda: ffid.identify(str(mission.file), record),  # type: ignore[arg-type]
        lambda: ffid.doctor(None, record),  # type: ignore[arg-type]
        lambda: ffid.Record.read("rec.csv", record),  # type: ignore[arg-type]
        lambda: ffid.plan_excitation("m.toml"),  # type: ignore[arg-type]
    ):
        with pytest.raises(TypeError, match="a Mission is needed, not .*; Mission.load reads one"):
            call()
    for wrong in ({"t": record.t}, record.q, iter([record])):
        with pytest.raises(TypeError, match="records are a Record, a path, or a list of them, not"):
            ffid.identify(mission, wrong)  # type: ignore[arg-type]
