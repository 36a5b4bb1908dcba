# Every target sets up what it needs: a fresh clone needs Python >= 3.10 with venv, and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEMO_FRAMES ?= ::10

.PHONY: install demo test nightly lint format checkpoint clean
.DEFAULT_GOAL := install

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 13))' || \
		{ echo "advpipe needs Python 3.10 to 3.12 (open3d has no build for others); set PYTHON=python3.12"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ echo "cannot make a virtual environment; on Debian or Ubuntu: apt-get install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --upgrade --constraint constraints.txt --editable '.[dev]'
	@touch $@

demo: $(INSTALLED)
	$(BIN)/advpipe simulate boulevard --overwrite
	$(BIN)/advpipe attack datasets/boulevard --type detach --ratio 0.01 --frames $(DEMO_FRAMES) --overwrite
	$(BIN)/advpipe evaluate datasets/boulevard --overwrite

test: $(INSTALLED) lint
	$(BIN)/python -m pytest -n 2 -m "not nightly" tests

nightly: $(INSTALLED)
	$(BIN)/python -m pytest tests

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) build dist *.egg-info
