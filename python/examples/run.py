"""Runs the notebook from top to bottom in a temporary folder, and fails if a cell does.

    python python/examples/run.py [OUT.ipynb]     needs nbclient, ipykernel and matplotlib; writes the notebook with its pictures to OUT
"""

import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

notebook = nbformat.read(Path(__file__).parent / "street.ipynb", as_version=4)
with tempfile.TemporaryDirectory() as folder:
    NotebookClient(notebook, timeout=900, resources={"metadata": {"path": folder}}).execute()
if len(sys.argv) > 1:
    nbformat.write(notebook, sys.argv[1])
