"""What stands for a data frame where pandas is not installed."""

from __future__ import annotations

import sys
from typing import Any

import ffid
import pytest

ROWS: list[dict[str, Any]] = [
    {"name": "base.mass", "value": 407.29311, "std": 9.7872, "interval95": [388.1, None], "unit": "kg"},
    {"name": "wing.k[0]", "value": 311.9, "std": None, "interval95": None, "unit": "N m/rad", "truth": 310},
]


def test_rows_columns_and_tables_of_some_columns() -> None:
    table = ffid.Table(ROWS)
    assert table.columns == ["name", "value", "std", "interval95", "unit", "truth"]
    assert len(table) == 2 and table[1] == ROWS[1] and table[-2]["truth"] is None
    assert table["value"] == [407.29311, 311.9]
    assert table[["unit", "name"]] == [{"unit": "kg", "name": "base.mass"}, {"unit": "N m/rad", "name": "wing.k[0]"}]
    assert table[1:] == ffid.Table(ROWS)[[*table.columns]][1:]
    with pytest.raises(KeyError, match="'mass'; the columns are name, value, std, interval95, unit, truth"):
        table[["name", "mass"]]
    assert len(ffid.Table([])) == 0 and str(ffid.Table([])) == ""


def test_printed_names_stand_to_the_left_and_numbers_to_the_right() -> None:
    assert str(ffid.Table(ROWS)[["name", "value", "std", "interval95"]]).splitlines() == [
        "name         value     std     interval95",
        "base.mass  407.293  9.7872  [388.1, None]",
        "wing.k[0]    311.9",
    ]
    assert "<td>N m/rad</td>" in ffid.Table(ROWS)._repr_html_()


def test_a_result_hands_it_out_without_pandas(result: ffid.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = result.parameters
    monkeypatch.setitem(sys.modules, "pandas", None)
    table = result.parameters
    assert isinstance(table, ffid.Table) and table.columns == list(frame.columns)
    assert table[["name", "value"]]["value"] == list(frame["value"])


def test_data_frames_are_made_of_it() -> None:
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    table = ffid.Table(ROWS)[["name", "value"]]
    assert list(pandas.DataFrame(table)["value"]) == table["value"]
    assert polars.DataFrame(table)["name"].to_list() == table["name"]
