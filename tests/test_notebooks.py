"""Each notebook is paired with its text form, carries no outputs, and runs."""

import shutil
from pathlib import Path

import jupytext
import nbclient
import nbformat
import pytest

FOLDER = Path(__file__).parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
PRINTED = {  # what shows that a notebook came to its point
    "01_first_docking": ["docked: True"],
    "02_docking_navigation": ["loses to the paper's filter: none", "not met: none"],
    "03_identification": ["these are degrees", "below 2 %: True; better than its start: True", "lake.yaml  docked"],
    "04_cooperative": ["twenty times worse in silence: True", "m longer: True"],
    "05_formations": ["[  0.  60. 120.] degrees", "worse, and claims to be better: True"],
    "06_bayes_navigation": ["below a tenth of dead reckoning: True"],
    "07_campaign": ["8 trials, then 12", "the same to the last bit: True"],
}


def test_there_are_notebooks_and_each_has_its_text():
    assert NOTEBOOKS
    assert {path.stem for path in NOTEBOOKS} == {path.stem for path in FOLDER.glob("*.py")}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_says_what_its_text_says_and_has_no_outputs(path):
    notebook, text = nbformat.read(path, as_version=4), jupytext.read(path.with_suffix(".py"))
    assert [(c.cell_type, c.source) for c in notebook.cells] == [(c.cell_type, c.source) for c in text.cells]
    assert not any(cell.get("outputs") for cell in notebook.cells)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs(path, tmp_path):
    copy = Path(shutil.copy(path, tmp_path))
    notebook = nbformat.read(copy, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    printed = "".join(o.get("text", "") for c in notebook.cells for o in c.get("outputs", []))
    for text in PRINTED[path.stem]:
        assert text in printed
