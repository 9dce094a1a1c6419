"""What records and motions need of a mission, so that they need not know the whole of it, which knows them."""

from __future__ import annotations

from typing import Protocol

from . import _ffid
from .model import Model


class MissionLike(Protocol):
    """A :class:`ffid.Mission`."""

    _core: _ffid.Mission

    @property
    def joints(self) -> list[str]:
        """Names of the moving joints, in order."""
        ...

    @property
    def model(self) -> Model:
        """The dynamics."""
        ...
