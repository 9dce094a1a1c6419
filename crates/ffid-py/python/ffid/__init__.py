"""In-orbit identification of free-floating robots.

Measured joint motion, joint torques and base gyro in; base, arm, panel, fuel and payload parameters out, each with its standard deviation
and a statement of what the data cannot tell. Units are SI; arrays have one sample per row.

>>> import ffid
>>> mission = ffid.Mission.load("m.toml")
>>> record = ffid.Record.read("rec.csv", mission)
>>> result = ffid.identify(mission, record, held_out=0.3)
>>> print(result.verdict)
"""

from __future__ import annotations

from ._ffid import __version__
from .errors import (
    ArrayError,
    ConfigError,
    DataError,
    FfidError,
    FfidWarning,
    IllPosedError,
    InternalError,
    ModelError,
    NumericalError,
    OutputError,
    Problem,
)
from .mission import Mission
from .model import Model
from .motion import Motion, Plan, Preflight, plan_excitation, preflight
from .record import Record
from .result import Result, Validation, identify

__all__ = [
    "ArrayError",
    "ConfigError",
    "DataError",
    "FfidError",
    "FfidWarning",
    "IllPosedError",
    "InternalError",
    "Mission",
    "Model",
    "ModelError",
    "Motion",
    "NumericalError",
    "OutputError",
    "Plan",
    "Preflight",
    "Problem",
    "Record",
    "Result",
    "Validation",
    "__version__",
    "identify",
    "plan_excitation",
    "preflight",
]
