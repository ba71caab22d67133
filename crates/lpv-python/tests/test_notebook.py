"""The notebook of the documentation runs from its first line to its last, as does the example."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT


def test_notebook(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("control")
    pytest.importorskip("matplotlib")
    notebook = nbformat.read(ROOT / "docs/python.ipynb", as_version=4)
    lines = [l for cell in notebook.cells if cell.cell_type == "code" for l in cell.source.splitlines() if l.strip()]
    assert len(lines) <= 20
    client = nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    shown = "".join(str(output) for cell in notebook.cells for output in cell.get("outputs", []))
    assert "coulomb-friction" in shown and "image/png" in shown


def test_example(tmp_path: Path) -> None:
    example = Path(__file__).parents[1] / "examples/from_arrays.py"
    said = subprocess.run([sys.executable, example], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert "good" in said
