"""Problems in the words of Python, and no bad argument that is a panic."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import ffid
import numpy as np
import pytest
from ffid.errors import _as_keywords

pytestmark = pytest.mark.filterwarnings("ignore::ffid.FfidWarning")


@pytest.mark.parametrize(
    ("of_the_command", "of_python"),
    [
        ("give --resample, or record again", "give resample=True, or record again"),
        ("give --gaps drop", 'give gaps="drop"'),
        ("use --allow stuck to let it through", 'use allow=["stuck"] to let it through'),
        ("give --allow unit-mismatch", 'give allow=["unit-mismatch"]'),
        ("give another --out, or --force to replace it", "give another folder, or force=True to replace it"),
        ("leave --low-pass out", "leave low_pass out"),
        ("--starts=0: must be from 1 on", "starts=0: must be from 1 on"),
        ("--adopt gyro-misalignment estimates it", 'adopt=["gyro-misalignment"] estimates it'),
        ("a - b -- c", "a - b -- c"),
    ],
)
def test_options_in_messages_are_keywords(of_the_command: str, of_python: str) -> None:
    assert _as_keywords(of_the_command) == of_python


def arguments() -> list[Any]:
    """What somebody may give by mistake."""
    a = np.zeros((3, 2))
    return [
        None, 0, -1, 2**70, math.nan, -math.inf, "", "no such", "\0", b"x", [], {}, a, a.astype(object), np.zeros((0, 7)), [[1.0], [1.0, 2.0]],
        np.array(["x"]), object(), lambda t: t, Path("/"), [None], [[]], np.zeros((1, 1, 1, 1)), np.full((4, 4), np.nan), True, 1e308, (), -0.0,
    ]  # fmt: skip


# A call must end with a value or with an exception that is no bug: neither a panic nor an internal error.
def tried(f: Any, *args: Any, **kwargs: Any) -> None:
    try:
        f(*args, **kwargs)
    except ffid.InternalError as e:
        raise AssertionError(f"{f} {args} {kwargs}") from e
    except Exception:  # noqa: BLE001
        return


def test_no_argument_is_a_panic(mission: ffid.Mission, record: ffid.Record, fixtures: Path, tmp_path: Path) -> None:
    model = mission.model
    q, v, a = model.random_states(3)
    for x in arguments():
        for method in (model.rnea, model.forward_dynamics, model.regressor, model.derivatives, model.regressor_qr):
            tried(method, x, v, a)
            tried(method, q, x, a)
            tried(method, q, v, x)
        for f in (model.rnea, model.regressor):
            tried(f, q, v, a, out=x)
            tried(f, q, v, a, parameters=x)
            if not isinstance(x, int) or x < 1 << 60:
                tried(f, q, v, a, threads=x)
        tried(model.hybrid_dynamics, q, v, x)
        tried(model.frame, x, q)
        tried(model.frame, model.frames[0], x)
        tried(model.momentum, q, x)
        tried(model.mass_matrix, x)
        tried(model.base_parameters, q, v, a, tolerance=x)
        tried(ffid.Mission.load, x)
        tried(ffid.Model.from_urdf, fixtures / "verdict" / "robot.urdf", gravity=x)
        tried(ffid.Record.read, x, mission)
        tried(ffid.Record.from_pandas, mission, x)
        tried(ffid.Motion.from_arrays, mission, t=x, q=record.q[:9])
        tried(ffid.Motion.from_arrays, mission, t=record.t[:9], q=x)
        tried(ffid.Motion.from_function, mission, x, 1.0)
        tried(ffid.Motion.from_function, mission, lambda t, x=x: x, 1.0)
        tried(mission.modes, q=x)
        tried(mission.simulate, record.t[:50], record.q[:50], hold=x)
        tried(mission.simulate, record.t[:50], record.q[:50], seed=x)
        tried(mission.with_values, {"tank.mass": x})
        tried(mission.with_uncertain, x)
        tried(ffid.Mission.from_toml, x)
        tried(ffid.preflight, mission, x)
        tried(ffid.identify, mission, x)
        tried(ffid.identify, x, record)
        tried(ffid.doctor, mission, x)
        tried(ffid.Result.load, x)
    for name, x in itertools.product(("t", "q", "tau", "gyro", "qd", "att", "t_tau"), arguments()):
        given: dict[str, Any] = {"t": record.t[:40], "q": record.q[:40], "tau": record.tau[:40], "gyro": record.gyro[:40]}  # type: ignore[index]
        tried(ffid.Record.from_arrays, mission, **(given | {name: x}))


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("held_out", 1.5),
        ("held_out", float("nan")),
        ("starts", 0),
        ("starts", 1.5),
        ("prior", -1.0),
        ("prior", "wide"),
        ("sample", 3),
        ("max_iterations", 0),
        ("max_chi2", float("inf")),
        ("torque_noise", 0),
        ("adopt", ["no-such-error"]),
        ("compare", ["nothing"]),
        ("method", "guess"),
        ("ties", "no-such-file.toml"),
        ("prior_from", "no-such-folder"),
        ("low_pass", 5.0),
        ("uncertain", "maybe"),
        ("uncertain", [{"bodies": ["base"], "mass": 0.1}]),
        ("seed", -1),
    ],
)
def test_values_that_cannot_be_are_refused_before_the_fit(mission: ffid.Mission, record: ffid.Record, option: str, value: Any) -> None:
    calls: list[Any] = []
    with pytest.raises((ffid.FfidError, ValueError, TypeError)) as e:
        ffid.identify(mission, record, progress=lambda *x: calls.append(x), **{option: value})
    assert not isinstance(e.value, ffid.InternalError)
    # The message names the option, or the value where it is from a list.
    said = str(e.value)
    assert option in said or option.replace("_", "-") in said or str(value) in said or "mass" in said, said
    assert not calls
