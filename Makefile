# make setup | demo | test | test-lowest | lint | bench | reliability. Everything is installed into .venv; PYTHON picks the interpreter.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.PHONY: setup demo test test-lowest lint bench reliability clean

setup: $(STAMP)
	@sh tools/llvm.sh

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt torch
	$(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

demo: setup
	$(BIN)/shotenv demo

test: setup
	$(BIN)/python -m pytest --numprocesses logical --maxprocesses 8 --dist loadfile

# The lowest versions that pyproject.toml allows, in an environment of their own (tools/lowest.sh).
test-lowest:
	sh tools/lowest.sh $(PYTHON) .venv-lowest
	.venv-lowest/bin/python -m pytest --numprocesses logical --maxprocesses 8 --dist loadfile

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup
	$(BIN)/python -m benchmarks

reliability: setup
	$(BIN)/python -m reliability

clean:
	rm -rf $(VENV) .venv-lowest build dist runs
