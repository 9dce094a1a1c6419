"""The notebooks run, and so does the code of the pages; every public name is documented; modules import each other in no circle."""

from __future__ import annotations

import ast
import doctest
import graphlib
import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import ffid
import pytest

tomllib = pytest.importorskip("tomllib")
try:
    import resource
except ImportError:  # Windows has no limits of a process.
    resource = None  # type: ignore[assignment]

ROOT = Path(__file__).resolve().parents[3]
PAGES = {"docs/python.md": [], "README.md": [], "docs/coming-from.md": ["pinocchio", "mujoco"]}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem)
def test_notebooks_run(path: Path) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    book = nbformat.read(path, as_version=4)
    assert not any(c.get("outputs") for c in book.cells), "notebooks are kept without outputs"
    # Half an hour of computing, whatever else the machine does; two hours for one that waits in vain.
    if resource:
        book.cells.insert(0, nbformat.v4.new_code_cell("import resource\nresource.setrlimit(resource.RLIMIT_CPU, (1800, 1800))"))
    nbclient.NotebookClient(book, timeout=7200, resources={"metadata": {"path": str(path.parent)}}).execute()


@pytest.mark.parametrize("page", PAGES)
def test_code_of_the_pages_runs(page: str, tmp_path: Path) -> None:
    for needed in PAGES[page]:
        pytest.importorskip(needed)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks, page
    # Who follows the README has what it installs, which is not pandas.
    without = "import sys\nsys.modules['pandas'] = None\n" if page == "README.md" else ""
    code = without + "import warnings\nwarnings.simplefilter('ignore')\nimport matplotlib\nmatplotlib.use('svg')\n" + "\n".join(blocks)
    for folder in ("fixtures", "docs"):
        code = code.replace(f'"{folder}/', f'"{ROOT.as_posix()}/{folder}/')
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=3600)


@pytest.mark.skipif("antenna_boom" not in ffid.appendage_kinds(), reason="a wheel without the boom; `.ci/full python` builds one with it")
@pytest.mark.filterwarnings("ignore")
def test_an_appendage_of_ones_own_does_what_its_page_prints(monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs" / "python-appendages.md").read_text()
    session = "\n".join(re.findall(r"```text\n(>>>.*?)```", page, re.DOTALL))
    monkeypatch.chdir(ROOT)
    test = doctest.DocTestParser().get_doctest(session, {}, "python-appendages.md", None, 0)
    assert len(test.examples) == 7
    assert doctest.DocTestRunner().run(test).failed == 0


def test_modules_import_each_other_in_no_circle() -> None:
    folder = Path(ffid.__file__).parent
    graph: dict[str, set[str]] = {}
    # Those for the type checker alone and those within functions count as well.
    for path in folder.glob("*.py"):
        nodes = [n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.ImportFrom) and n.level == 1]
        graph[path.stem] = {n.module for n in nodes if n.module} | {a.name for n in nodes if not n.module for a in n.names}
    assert graph["fit"] >= {"mission", "result"}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def public() -> list[tuple[str, Any, Any]]:
    """Every public name: place, object, the class it is of."""
    found: list[tuple[str, Any, Any]] = []
    for name in ffid.__all__:
        x = getattr(ffid, name)
        if not callable(x):
            continue
        found.append((name, x, None))
        if inspect.isclass(x):
            found += [(f"{name}.{k}", v, x) for k, v in vars(x).items() if not k.startswith("_")]
    return found


def test_every_public_name_is_documented() -> None:
    silent = []
    for place, member, _ in public():
        documented = isinstance(member, (property, classmethod, staticmethod)) or callable(member)
        if documented and not inspect.getdoc(member):
            silent.append(place)
    assert silent == []


def test_every_argument_is_documented() -> None:
    silent = []
    for place, member, owner in public():
        f = getattr(member, "__func__", member)
        if not inspect.isfunction(f):
            continue
        text = f"{inspect.getdoc(f)} {inspect.getdoc(owner) if owner else ''}"
        names = set(inspect.signature(f).parameters) - {"self", "cls"}
        silent += [f"{place}({n})" for n in sorted(names) if not re.search(rf"\b{n}\b", text)]
    assert silent == []


def test_arrays_have_their_shapes() -> None:
    """What takes or returns an array says how it is laid out."""
    silent = []
    for place, member, owner in public():
        f = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
        if not inspect.isfunction(f) or "Array" not in str(inspect.signature(f)):
            continue
        text = f"{inspect.getdoc(f)} {inspect.getdoc(owner) if owner else ''}"
        if not re.search(r"``\([^`]*,[^`]*\)``|_names", text):
            silent.append(place)
    assert silent == []


def test_the_reference_is_that_of_the_sources() -> None:
    subprocess.run([sys.executable, ROOT / "crates" / "ffid-py" / "docs" / "reference.py", "--check"], check=True)


def test_the_book_lists_the_notebooks() -> None:
    listed = (ROOT / "docs" / "python.md").read_text()
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        assert f"notebooks/{path.name}" in listed, path.name


def test_the_version_is_that_of_the_crates() -> None:
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    assert ffid.__version__ == version
