"""docs/tutorial.ipynb runs from top to bottom and says what it says in the repository."""

import json
import pathlib

import nbclient
import nbformat

NOTEBOOK = pathlib.Path(__file__).parents[2] / "docs" / "tutorial.ipynb"


def said(notebook):
    """The text of every cell; what players and pictures show is in no text."""
    texts = []
    for cell in notebook.cells:
        outputs = cell.outputs if cell.cell_type == "code" else []
        streams = [output for output in outputs if output.output_type == "stream"]
        # How fast it went is on stderr.
        streams = ["".join(output.text) for output in streams if output.name == "stdout"]
        results = [output.data.get("text/plain", "") for output in outputs if output.output_type == "execute_result"]
        texts.append("".join([*streams, *results]))
    return texts


def test_the_notebook_says_the_same_again(tmp_path):
    known = nbformat.read(NOTEBOOK, as_version=4)
    anew = nbformat.from_dict(json.loads(json.dumps(known)))
    nbclient.NotebookClient(anew, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert any(said(known)), "the notebook in the repository has its outputs"
    assert said(anew) == said(known)
