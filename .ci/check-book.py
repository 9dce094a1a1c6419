"""Holds a book that mdBook has built to its links: files and headings that its pages refer to are there.

Usage: python3 .ci/check-book.py target/book
"""

from __future__ import annotations

import html
import re
import sys
from functools import cache
from pathlib import Path


@cache
def anchors(page: Path) -> set[str]:
    return set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding="utf-8")))


def broken(page: Path) -> list[str]:
    """References of the text of a page that lead nowhere."""
    text = page.read_text(encoding="utf-8").partition("<main>")[2].partition("</main>")[0]
    found = []
    for reference in map(html.unescape, re.findall(r'(?:href|src)="([^"]+)"', text)):
        if re.match(r"[a-z]+:", reference):
            continue
        path, _, anchor = reference.partition("#")
        target = (page.parent / path).resolve() if path else page.resolve()
        if target.is_dir():
            target /= "index.html"
        if not target.exists() or (anchor and target.suffix == ".html" and anchor not in anchors(target)):
            found.append(f"{page}: {reference}")
    return found


def main() -> int:
    book = Path(sys.argv[1])
    # Made of the others.
    pages = [p for p in sorted(book.rglob("*.html")) if p.name not in ("print.html", "toc.html", "404.html")]
    if not pages:
        print(f"{book}: no pages", file=sys.stderr)
        return 1
    faults = [fault for page in pages for fault in broken(page)]
    print("\n".join([*faults, f"{len(pages)} pages, {len(faults)} references that lead nowhere"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
