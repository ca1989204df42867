#!/bin/sh
# lowest.sh PYTHON VENV: a virtual environment with the lowest version of every package that
# pyproject.toml allows, so that its lower bounds are tested and not guessed.
#
# Torch is the one that constraints.txt pins: older ones bring gigabytes of CUDA on Linux. What these
# packages want themselves comes in its newest version.
set -eu
python=$1 venv=$2
"$python" -m venv "$venv"
install="$venv/bin/python -m pip install --quiet --disable-pip-version-check"
$install uv
echo "torch ; sys_platform == 'never'" >"$venv/overrides.txt"
"$venv/bin/uv" pip compile --quiet --resolution lowest-direct --extra dev --no-annotate --no-header \
    --python "$venv/bin/python" --override "$venv/overrides.txt" --output-file "$venv/lowest.txt" pyproject.toml
$install --constraint constraints.txt torch
$install --requirement "$venv/lowest.txt"
$install --no-deps --editable .
"$venv/bin/python" -m pip check
