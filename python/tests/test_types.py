"""The stubs match the native module, and the package's types are consistent."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")

SETTINGS = Path(__file__).parents[1] / "pyproject.toml"


def succeeds(folder, *words):
    # Not from the sources' folder, so that the installed package is checked.
    done = subprocess.run([sys.executable, "-m", *map(str, words)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_stubs_are_of_the_native_module(tmp_path):
    """Every name, argument and default, without exceptions."""
    succeeds(tmp_path, "mypy.stubtest", "deepfusion._native", "--mypy-config-file", SETTINGS)


def test_the_package_has_no_wrong_types(tmp_path):
    succeeds(tmp_path, "mypy", "--config-file", SETTINGS, "--cache-dir", tmp_path, "-p", "deepfusion")
