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
from .command import appendage_kinds, convert, schema
from .diagnosis import Diagnosis, doctor
from .draws import Draws, WeightedDraws
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
from .fit import identify
from .interrupted import Interrupted
from .mission import Mission
from .model import BaseParameters, Derivatives, Hybrid, Model, Momentum
from .motion import Motion, Plan, Preflight
from .page import Page
from .planning import plan_excitation, preflight
from .record import Record
from .result import Result
from .table import Table
from .validation import Validation

__all__ = [
    "ArrayError",
    "BaseParameters",
    "ConfigError",
    "DataError",
    "Derivatives",
    "Diagnosis",
    "Draws",
    "FfidError",
    "FfidWarning",
    "Hybrid",
    "IllPosedError",
    "InternalError",
    "Interrupted",
    "Mission",
    "Model",
    "ModelError",
    "Momentum",
    "Motion",
    "NumericalError",
    "OutputError",
    "Page",
    "Plan",
    "Preflight",
    "Problem",
    "Record",
    "Result",
    "Table",
    "Validation",
    "WeightedDraws",
    "__version__",
    "appendage_kinds",
    "convert",
    "doctor",
    "identify",
    "plan_excitation",
    "preflight",
    "schema",
]
