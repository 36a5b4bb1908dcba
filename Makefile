# Every target sets up what it needs; a fresh clone needs Python >= 3.10 with venv, and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEMO_FRAMES ?= ::10
FUZZ_SECONDS ?= 3600
FUZZ_SEED ?= 0

.PHONY: install demo test nightly fuzz lint format checkpoint clean
.DEFAULT_GOAL := install

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
		{ echo "advpipe needs Python 3.10 or later; set PYTHON=python3.11, for instance"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ echo "cannot make a virtual environment; on Debian or Ubuntu: apt-get install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --upgrade --constraint constraints.txt --editable '.[dev]'
	@$(BIN)/python -c 'import open3d' || \
		{ echo "open3d does not import; from Python 3.13 on it needs: apt-get install libusb-1.0-0"; exit 1; }
	@touch $@

demo: $(INSTALLED)
	$(BIN)/advpipe simulate district --overwrite
	$(BIN)/advpipe attack datasets/district --type detach --ratio 0.01 --frames $(DEMO_FRAMES) --overwrite
	$(BIN)/advpipe evaluate datasets/district --baseline-tries 5 --overwrite

test: $(INSTALLED) lint
	$(BIN)/python -m pytest -n 2 -m "not nightly" tests

nightly: $(INSTALLED)
	$(BIN)/python -m pytest tests

# Hostile inputs of every kind; docs/fuzzing.md says how to run one again. Exit code 1 for findings.
fuzz: $(INSTALLED)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev,fuzz]'
	nice -n 15 $(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

checkpoint: $(INSTALLED)
	benchmarks/train_small.sh

clean:
	rm -rf $(VENV) build dist *.egg-info
