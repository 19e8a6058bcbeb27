"""The notebook, from top to bottom, as examples/run.py runs it."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("matplotlib")

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_the_notebook_runs_and_shows_its_pictures(tmp_path):
    import nbformat

    out = tmp_path / "street.ipynb"
    subprocess.run([sys.executable, str(EXAMPLES / "run.py"), str(out)], check=True, timeout=1800)
    drawn = 0
    for cell in nbformat.read(out, as_version=4).cells:
        if cell.cell_type == "code" and ("plt.figure(" in cell.source or "plt.subplots(" in cell.source):
            shown = [kind for output in cell.outputs for kind in output.get("data", {})]
            assert "image/png" in shown, cell.source
            drawn += 1
    assert drawn >= 5
