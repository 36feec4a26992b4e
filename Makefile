# make setup | demo | test | test-fast | attack: each from an empty machine with Python 3.11 or 3.12, nothing else.

PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3)
TORCH ?= torch==2.13.0
BIN := .venv/bin
READY := .venv/.gsac-ready

.PHONY: setup demo test test-fast attack params docs shaders metas lint debian

setup: $(READY)

# torch comes first and pinned: left to the resolver it may be any of a wide range.
$(READY): pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv || { rm -rf .venv; \
	  echo "make: $(PYTHON) cannot make a virtual environment; on Debian: apt-get install python3-venv" >&2; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(TORCH)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	$(BIN)/gsac models pull
	@touch $@

demo: setup
	$(BIN)/gsac demo

# Slow tests run alone: some measure time.
test: setup debian lint
	$(BIN)/python -m pytest -m 'not slow' -n 2
	$(BIN)/python -m pytest -m slow

test-fast: setup
	$(BIN)/python -m pytest -m 'not slow' -n 2

# The long versions of what the tests try in small: hours, for the table in docs/lab/attacks.md.
attack: setup debian
	PYTHONPATH=tests $(BIN)/python -m attack
	GSAC_TRIALS=3000 $(BIN)/python -m pytest -q tests/promises/test_poisoned_records.py
	PYTHONPATH=tests $(BIN)/python -m support.readers 100000
	GSAC_READER_MUTANTS=60000 $(BIN)/python -m pytest -q -s tests/viewer/test_reader_attack.py -k fuzz

# Some tests use Debian packages; where they may not be installed, those tests skip and name them.
debian:
	@bash .ci/debian-packages

# Writes params.yaml from the stages' defaults.
params: setup
	$(BIN)/python -m gsac.pipeline.params

# Writes cli.md, events.md, findings.md, quality.md and stages/ in docs/ from the code.
docs: setup
	$(BIN)/python -m gsac.pipeline.reference

# Writes the viewer page's shaders from the Unity package's HLSL; needs glslang-tools and npm.
shaders: setup
	$(BIN)/python -m gsac.viewer.wgsl

# Writes the .meta files of the Unity package's files.
metas: setup
	$(BIN)/python -m gsac.unity.package

lint: setup
	$(BIN)/ruff check
	$(BIN)/basedpyright --baselinemode=lock
