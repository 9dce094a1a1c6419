"""What the tests share: a mission, a record of it, and the files of the project."""

from __future__ import annotations

import warnings
from pathlib import Path

import ffid
import pytest

ROOT = Path(__file__).resolve().parents[3]
FIXTURES = ROOT / "fixtures"


@pytest.fixture(scope="session")
def fixtures() -> Path:
    return FIXTURES


@pytest.fixture(scope="session")
def mission() -> ffid.Mission:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ffid.FfidWarning)
        return ffid.Mission.load(FIXTURES / "verdict" / "start.toml")


@pytest.fixture(scope="session")
def record(mission: ffid.Mission) -> ffid.Record:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ffid.FfidWarning)
        return ffid.Record.read(FIXTURES / "verdict" / "m1.parquet", mission)


@pytest.fixture(scope="session")
def result(mission: ffid.Mission, record: ffid.Record) -> ffid.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ffid.FfidWarning)
        return ffid.identify(mission, record)
