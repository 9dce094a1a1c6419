"""Rows as a data frame, where there is a library for it, and as a table that can be read and selected from where there is none."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from typing import Any, overload

Row = dict[str, Any]


class Table(Sequence[Row]):
    """Rows with columns, where pandas is not installed: what a result hands out as a data frame elsewhere.

    A number selects a row, a name the values of a column (a list), a list of names a table of these columns, as in pandas;
    ``pandas.DataFrame(table)`` and ``polars.DataFrame(table)`` are data frames of it. Printed, it is aligned text.

    Args:
        rows: Rows, each a dictionary from the name of a column to its value. A column that a row lacks is None there.
    """

    def __init__(self, rows: Sequence[Row]) -> None:
        self._columns = list(dict.fromkeys(name for row in rows for name in row))
        self._rows = [{name: row.get(name) for name in self._columns} for row in rows]

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self._columns)

    @overload
    def __getitem__(self, key: int) -> Row: ...
    @overload
    def __getitem__(self, key: str) -> list[Any]: ...
    @overload
    def __getitem__(self, key: slice | list[str]) -> Table: ...
    def __getitem__(self, key: int | str | slice | list[str]) -> Row | list[Any] | Table:
        if isinstance(key, int):
            return self._rows[key]
        if isinstance(key, slice):
            return Table(self._rows[key])
        for name in [key] if isinstance(key, str) else key:
            if name not in self._columns:
                raise KeyError(f"{name!r}; the columns are {', '.join(self._columns) or 'none'}")
        if isinstance(key, str):
            return [row[key] for row in self._rows]
        return Table([{name: row[name] for name in key} for row in self._rows])

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    def __eq__(self, other: object) -> bool:
        return self._rows == (other._rows if isinstance(other, Table) else other)

    # It compares by what it holds, which can be changed.
    __hash__ = None  # type: ignore[assignment]

    def __str__(self) -> str:
        cells = [self._columns, *([_cell(row[name]) for name in self._columns] for row in self._rows)]
        widths = [max(map(len, column)) for column in zip(*cells)]
        # Text to the left, numbers to the right.
        text = [any(isinstance(row[name], str) for row in self._rows) for name in self._columns]
        lines = ("  ".join(c.ljust(w) if t else c.rjust(w) for c, w, t in zip(line, widths, text)).rstrip() for line in cells)
        return "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self._columns)
        body = ("".join(f"<td>{html.escape(_cell(row[name]))}</td>" for name in self._columns) for row in self._rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(f'<tr>{r}</tr>' for r in body)}</tbody></table>"


def rows(found: Sequence[Row]) -> Any:
    """A data frame where pandas is installed, else a :class:`Table`."""
    try:
        import pandas
    except ImportError:
        return Table(found)
    return pandas.DataFrame(found)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join('None' if x is None else _cell(x) for x in value)}]"
    return str(value)
