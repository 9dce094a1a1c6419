"""The notebooks run, and so does the code of the pages; every public name is documented."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path

import ffid
import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGES = ["docs/python.md", "README.md"]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem)
def test_notebooks_run(path: Path) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    book = nbformat.read(path, as_version=4)
    assert not any(c.get("outputs") for c in book.cells), "notebooks are kept without outputs"
    nbclient.NotebookClient(book, timeout=300, resources={"metadata": {"path": str(path.parent)}}).execute()


@pytest.mark.parametrize("page", PAGES)
def test_code_of_the_pages_runs(page: str, tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks, page
    code = "import warnings\nwarnings.simplefilter('ignore')\nimport matplotlib\nmatplotlib.use('svg')\n" + "\n".join(blocks)
    code = code.replace('"fixtures/', f'"{ROOT.as_posix()}/fixtures/')
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=300)


def test_every_public_name_is_documented() -> None:
    silent = []
    for name in ffid.__all__:
        x = getattr(ffid, name)
        if not callable(x):
            continue
        members = [(name, x)]
        if inspect.isclass(x):
            members += [(f"{name}.{k}", v) for k, v in vars(x).items() if not k.startswith("_")]
        for place, member in members:
            documented = isinstance(member, (property, classmethod, staticmethod)) or callable(member)
            if documented and not inspect.getdoc(member):
                silent.append(place)
    assert silent == []
