#!/usr/bin/env bash
# Builds the package into a fresh virtual environment, as `pip install .` does for a user, and runs its tests there.
#
#   python/test.sh [FOLDER]     default: a temporary one
#   EXTRAS=test,test-ray,test-torch,notebook python/test.sh     also the tests of deepfusion.ray, those with torch, and the notebook
set -euo pipefail
# Relative to the caller's folder.
if [ -n "${DEEPFUSION:-}" ]; then
    DEEPFUSION=$(realpath "$DEEPFUSION")
    export DEEPFUSION
fi
venv=$(realpath -m "${1:-$(mktemp -d)}")
cd "$(dirname "$0")"
python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --upgrade pip
"$venv/bin/pip" install --quiet ".[${EXTRAS:-test}]"
# Not in this folder: its sources have no extension module.
tests=$PWD/tests
cd "$venv"
"$venv/bin/python" -m pytest -q "$tests"
