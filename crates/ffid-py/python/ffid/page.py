"""Pages: HTML that notebooks show and files hold."""

from __future__ import annotations

import html
import os
from pathlib import Path as FilePath

from ._options import Path


class Page(str):
    """A page of HTML, complete in itself: a text that a notebook shows and :meth:`save` writes."""

    def save(self, path: Path) -> None:
        """Writes the page.

        Args:
            path: The file; one that exists is replaced.
        """
        FilePath(os.fspath(path)).write_text(self, encoding="utf-8")

    def _repr_html_(self) -> str:
        style = "width: 100%; height: 640px; border: none"
        return f'<iframe srcdoc="{html.escape(self, quote=True)}" style="{style}"></iframe>'
