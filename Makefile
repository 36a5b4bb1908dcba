# Every target sets up what it needs; a fresh clone needs Python >= 3.10 with venv, and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
ORACLES := $(VENV)/.oracles
DEMO_FRAMES ?= ::5
FUZZ_SECONDS ?= 3600
FUZZ_SEED ?= 0
# PyTorch's index has a CPU build for Linux, 4.5 GB smaller than PyPI's CUDA build, which an empty TORCH_INDEX=
# selects. docs/install.md has a table of sizes.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
TORCH := $(shell sed -n '/^torch==/p' constraints.txt)
# Without --no-compile, pip compiles all modules to 0.5 GB of bytecode; Python compiles only those it imports.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile

.PHONY: install demo sample test wheel-test nightly oracles fuzz lint format checkpoint docs viewer clean
.DEFAULT_GOAL := install

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
		{ echo "advpipe needs Python 3.10 or later; set PYTHON=python3.11, for instance"; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || \
		{ echo "cannot create a virtual environment; on Debian or Ubuntu: apt-get install python3-venv"; exit 1; }
	@echo "installing into $(VENV): 2.7 GB, mostly PyTorch, SUMO and Open3D (docs/install.md)"
	@test "$$(uname -s)" != Linux || test -z "$(TORCH_INDEX)" || \
		$(PIP_INSTALL) --no-deps --retries 0 --index-url $(TORCH_INDEX) $(TORCH) 2> /dev/null || \
		echo "$(TORCH_INDEX) has no $(TORCH) for this Python, or cannot be reached:" \
			"PyTorch comes from pip's usual index; on Linux that is the CUDA build, 4.5 GB more"
	$(PIP_INSTALL) --upgrade --constraint constraints.txt --editable '.[dev]'
	@# eclipse-sumo and libsumo contain the same 111 libraries, 230 MB; hard links keep one copy.
	@! command -v hardlink > /dev/null || \
		hardlink -t $(VENV)/lib/python*/site-packages/eclipse_sumo.libs \
			$(VENV)/lib/python*/site-packages/libsumo.libs > /dev/null 2>&1 || true
	@$(BIN)/python -m advpipe.pipeline.core.missing_library
	@touch $@

# All three stages on eight clouds of a map that the detector has not seen: under two minutes on two cores.
demo: $(INSTALLED)
	$(BIN)/advpipe simulate district --set simulation.duration_s=4 --out datasets/demo --overwrite
	$(BIN)/advpipe attack datasets/demo --type detach --ratio 1% --frames $(DEMO_FRAMES) --overwrite
	$(BIN)/advpipe evaluate datasets/demo --overwrite
	@echo "        $(BIN)/advpipe attacks"

# The data set that comes with advpipe: the same bytes of the same versions on the same machine, but for the
# report's times.
sample: $(INSTALLED)
	$(BIN)/advpipe run sample --out build/sample --overwrite
	cp build/sample/scenario.yaml build/sample/reports/small/report.html sample/
	cp build/sample/clean/clean_0.mcap build/sample/clean/metadata.yaml sample/clean/

# In the order of the folders: xdist would put files of few tests last, and those are the long ones.
test: $(INSTALLED) $(ORACLES) lint
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not nightly" tests

wheel-test:
	PYTHON=$(PYTHON) TORCH_INDEX=$(TORCH_INDEX) tests/wheel.sh

nightly: $(INSTALLED) $(ORACLES)
	$(BIN)/python -m pytest tests

# The development kits of nuScenes and Argoverse 2, 70 MB. Where they cannot be had, the tests that compare with
# them are skipped; on the integration server that is a failure.
oracles: $(ORACLES)

$(ORACLES): tests/oracles.txt | $(INSTALLED)
	$(PIP_INSTALL) --no-deps --requirement tests/oracles.txt && touch $@ || test -z "$$CI"

# Hostile inputs of all formats; docs/fuzzing.md explains how to repeat one. Exit code 1 for findings.
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

# The site of docs/, in build/site; `$(BIN)/mkdocs serve` shows it and follows changes.
docs: $(INSTALLED)
	$(BIN)/mkdocs build --strict

# The bundle of three.js that the 3D viewer is drawn with, from the npm registry; needs npm.
viewer:
	pipeline/viewer/three/make.sh

clean:
	rm -rf $(VENV) build dist *.egg-info
