"""The notebook runs from its first cell to its last, and has its pictures in it."""

from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parent.parent / "examples" / "first_wireframe.ipynb"
PICTURES = 3


def pictures(notebook):
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return sum("image/png" in output.get("data", {}) for output in outputs)


def test_the_notebook_runs_and_draws():
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("matplotlib"), pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert pictures(notebook) == PICTURES
    for cell in notebook.cells:
        cell.get("outputs", []).clear()
    nbclient.NotebookClient(notebook, timeout=300).execute()
    assert pictures(notebook) == PICTURES
