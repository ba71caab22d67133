"""The package as it is installed."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import lpvident

#: Longest import beside that of numpy and the interpreter, s.
IMPORT_S = 0.3

FOLDER = Path(lpvident.__file__).parent


def test_import_is_quick_and_brings_nothing_but_numpy() -> None:
    code = "import numpy, sys, time; t = time.perf_counter(); import lpvident; print(time.perf_counter() - t); print(*sys.modules)"
    best = 1e9
    for _ in range(5):
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
        best = min(best, float(said[0]))
        loaded = set(said[1].split())
    assert best < IMPORT_S
    assert not loaded & {"pandas", "xarray", "control", "matplotlib", "scipy", "tqdm", "IPython"}


def test_every_name_has_a_page_and_a_type() -> None:
    assert (FOLDER / "py.typed").is_file()
    for name in lpvident.__all__:
        found = getattr(lpvident, name)
        if isinstance(found, type):
            members = {k: v for k, v in vars(found).items() if not k.startswith("_")}
            pages = [found.__doc__, *(getattr(found, k).__doc__ for k, v in members.items() if callable(v) or isinstance(v, property))]
            assert all(pages), name
        elif callable(found):
            assert found.__doc__, name


def test_types_are_checked_and_refuse_a_setting_that_does_not_exist(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api")
    settings = Path(__file__).parents[1] / "pyproject.toml"
    user = tmp_path / "user.py"
    user.write_text(
        "import lpvident\n"
        "lpvident.identify('folder', order=4, lfr='exact', interpolation='spline')\n"
        "lpvident.identify('folder', ordr=4)\n"
        "lpvident.Bundle('folder').identify(lfr='large')\n"
        "lpvident.simulate_machine('folder', sed=1)\n"
    )
    said, trouble, _ = api.run(["--config-file", str(settings), "--cache-dir", str(tmp_path / "cache"), str(FOLDER), str(user)])
    wrong = [line.partition(" error: ")[0].rpartition("/")[2] for line in said.splitlines() if " error: " in line]
    assert trouble == "" and wrong == ["user.py:3:", "user.py:4:", "user.py:5:"], said


def test_the_stub_names_what_the_native_half_has() -> None:
    from lpvident import _lpvident

    tree = ast.parse((FOLDER / "_lpvident.pyi").read_text())
    stub = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    native = {name for name in vars(_lpvident) if not name.startswith("__")}
    assert set(stub) == native
    for name, node in stub.items():
        if isinstance(node, ast.ClassDef):
            members = {member.name for member in node.body if isinstance(member, ast.FunctionDef)} - {"__init__"}
            assert members == {m for m in vars(getattr(_lpvident, name)) if not m.startswith("__")}, name
