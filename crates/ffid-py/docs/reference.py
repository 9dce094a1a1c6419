"""Writes docs/python-reference.md from the sources of the package: signatures with their types, and docstrings.

Usage: python docs/reference.py [--check]

With --check nothing is written; a page that is not that of the sources ends with 1. Needs no wheel.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
SOURCES = HERE / "python" / "ffid"
PAGE = HERE.parents[1] / "docs" / "python-reference.md"
WIDTH = 110

GROUPS = {
    "Missions": ["Mission"],
    "Records": ["Record", "doctor", "Diagnosis", "convert"],
    "Motions": ["Motion", "plan_excitation", "Plan", "preflight", "Preflight"],
    "Identification": ["identify", "Result", "Validation", "Draws", "WeightedDraws", "Table"],
    "Dynamics over arrays": ["Model", "BaseParameters", "Derivatives", "Hybrid", "Momentum"],
    "Errors and warnings": [
        "Problem", "FfidError", "ModelError", "ConfigError", "DataError", "ArrayError", "IllPosedError", "NumericalError", "OutputError",
        "InternalError", "Interrupted", "FfidWarning",
    ],
    "Pages, schemas, kinds": ["Page", "schema", "appendage_kinds"],
}  # fmt: skip

Definition = ast.FunctionDef | ast.ClassDef


def definitions() -> tuple[list[str], dict[str, Definition]]:
    """Public names, and what the modules define."""
    found: dict[str, Definition] = {}
    public: list[str] = []
    for path in sorted(SOURCES.glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                found[node.name] = node
            elif path.name == "__init__.py" and isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                public = [str(x) for x in ast.literal_eval(node.value)]
    return public, found


def roles(text: str) -> str:
    """Docstring markup as Markdown: references and literals become code."""
    text = re.sub(r":(?:class|meth|func|attr):`~?([^`]+)`", r"`\1`", text)
    return text.replace("``", "`")


def inline(text: str) -> str:
    return roles(" ".join(text.split()))


def entries(text: str) -> list[tuple[str, str]]:
    """``name: what`` of an Args or Attributes section."""
    out: list[tuple[str, str]] = []
    for line in text.splitlines():
        # Continued lines are indented further.
        if line.strip() and not line.startswith("    "):
            name, _, what = line.partition(":")
            out.append((name.strip(), what.strip()))
        elif out:
            out[-1] = (out[-1][0], f"{out[-1][1]} {line.strip()}")
    return out


def docstring(node: Definition) -> list[str]:
    """The docstring as Markdown."""
    text = ast.get_docstring(node) or ""
    parts = re.split(r"(?m)^(Args|Attributes|Raises|Returns):\n", text)
    lines = []
    for paragraph in re.split(r"\n\s*\n", parts[0].strip()):
        if paragraph.strip():
            lines += [inline(paragraph), ""]
    for kind, body in zip(parts[1::2], parts[2::2]):
        words = {"Args": "Arguments:", "Attributes": "Attributes:", "Raises": "Raises:", "Returns": "Returns:"}[kind]
        body = "\n".join(line.removeprefix("    ") for line in body.splitlines())
        lines += [words, "", *(f"- `{name}`: {inline(what)}" for name, what in entries(body)), ""]
    return lines


def signature(name: str, node: ast.FunctionDef, bound: bool) -> str:
    """The signature, an argument per line where it is long."""
    a = node.args
    positional = a.posonlyargs + a.args
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(a.defaults)) + list(a.defaults)
    pairs = list(zip(positional, defaults))[1 if bound else 0 :]

    def one(arg: ast.arg, default: ast.expr | None) -> str:
        # What the modules call `MissionLike` among themselves is a mission to users.
        kind = f": {ast.unparse(arg.annotation).replace('MissionLike', 'Mission')}" if arg.annotation else ""
        return f"{arg.arg}{kind}" + (f" = {ast.unparse(default)}" if default is not None else "")

    words = [one(*p) for p in pairs]
    if a.vararg:
        words.append("*" + one(a.vararg, None))
    elif a.kwonlyargs:
        words.append("*")
    words += [one(arg, d) for arg, d in zip(a.kwonlyargs, a.kw_defaults)]
    if a.kwarg:
        words.append("**" + one(a.kwarg, None))
    back = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{name}({', '.join(words)}){back}"
    if len(line) <= WIDTH:
        return line
    return f"{name}(\n" + "".join(f"    {w},\n" for w in words) + f"){back}"


def decorators(node: ast.FunctionDef) -> set[str]:
    return {ast.unparse(d) for d in node.decorator_list}


def method(owner: str, node: ast.FunctionDef) -> list[str]:
    kinds = decorators(node)
    if "property" in kinds:
        back = ast.unparse(node.returns) if node.returns else "Any"
        return [f"#### `{owner}.{node.name}`: `{back}`", "", *docstring(node)]
    shown = {"__call__": f"{owner.lower()}", "__getitem__": None, "__len__": None}.get(node.name, f"{owner}.{node.name}")
    head = "()" if node.name == "__call__" else f".{node.name}"
    title = f"#### `{owner}{head}`"
    return [title, "", "```text", signature(shown or node.name, node, "staticmethod" not in kinds), "```", "", *docstring(node)]


def entry(name: str, node: Definition) -> list[str]:
    if isinstance(node, ast.FunctionDef):
        return [f"### `{name}`", "", "```text", signature(f"ffid.{name}", node, False), "```", "", *docstring(node)]
    bases = ", ".join(f"`{ast.unparse(b)}`" for b in node.bases)
    lines = [f"### `{name}`", "", *docstring(node)]
    if bases:
        lines += [f"Is a {bases}.", ""]
    for member in node.body:
        if isinstance(member, ast.FunctionDef) and (not member.name.startswith("_") or member.name == "__call__") and ast.get_docstring(member):
            lines += method(name, member)
    return lines


def page() -> str:
    public, found = definitions()
    listed = [n for names in GROUPS.values() for n in names]
    left = set(public) - set(listed) - {"__version__"}
    if left or set(listed) - set(public):
        raise SystemExit(f"GROUPS of {__file__} differ from __all__: {sorted(left | (set(listed) - set(public)))}")
    lines = [
        "# Python: all names",
        "",
        "Written by `crates/ffid-py/docs/reference.py` from the sources of the package, whose types are checked strictly; do not edit.",
        "[Python](python.md) is the introduction.",
        "",
        "Units are SI. Arrays are NumPy's of float64, with one sample or state per row: `(N, n)` are N rows of n joints. `Path` is a text or",
        "an `os.PathLike`, `ArrayLike` what NumPy makes an array of. `Progress` is called with what is done, how often, and its cost.",
        "",
    ]
    for group, names in GROUPS.items():
        lines += [f"## {group}", ""]
        for name in names:
            lines += entry(name, found[name])
    return "\n".join(lines).rstrip() + "\n"


def main() -> int:
    text = page()
    if "--check" in sys.argv[1:]:
        same = PAGE.exists() and PAGE.read_text(encoding="utf-8") == text
        if not same:
            print(f"{PAGE} is not that of the sources; run {__file__}", file=sys.stderr)
        return 0 if same else 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
