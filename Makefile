# One command each, the same on a laptop and in continuous integration.

# The interpreter that makes .venv: the one the pins were tried with, else any from 3.11 on; `make setup PYTHON=...` overrides.
PYTHON ?= $(shell for name in python3.11 python3.12 python3.13 python3; do \
	$$name -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && command -v $$name && break; done)
BIN := .venv/bin
# Python compiles what it imports when it first does, a small part of what is installed: that saves a third of the set-up.
PIP := $(BIN)/python -m pip install --disable-pip-version-check --no-compile -c constraints.txt
# Container images often set this; then each process would compile anew all that it imports, a second for a command and more for a test.
unexport PYTHONDONTWRITEBYTECODE
# Written last, so that it exists only where everything does; it holds the folder that .venv was made for.
STAMP := .venv/complete
# There while something is being installed; where it stays behind, an earlier try was cut short.
UNFINISHED := .venv/unfinished
# There when Ray is installed too (0.2 GB), for the test of a batch on a cluster.
CLUSTER := .venv/cluster
# There when the programs of tests/node/package.json are installed, which open exported files in tests. Without npm these tests are skipped.
NODE_PROGRAMS := tests/node/node_modules/.package-lock.json
# There when the largest of what tests import is compiled; else each worker would compile it for itself, at the same time.
COMPILED := .venv/compiled
# There when gradio is installed too, with 20 more packages (140 MB), which only the app needs.
APP := .venv/app

.PHONY: help setup demo app test long docs gpu bench mutants mutants-auto fuzz faults check format anew audit release
.DEFAULT_GOAL := help

help:
	@echo 'make setup   make .venv with semgs and all that running and testing need'
	@echo 'make demo    set up, then reconstruct the embedded scene'
	@echo 'make app     set up, then open a page in the browser: drop photos, get a labelled room'
	@echo 'make test    set up, then run the tests (minutes)'
	@echo 'make long    set up, then run the tests that take longer'
	@echo 'make gpu     set up, then run the tests that need a CUDA GPU'
	@echo 'make bench   set up, then measure time and memory (10 minutes)'
	@echo 'make mutants set up, then plant errors and see that tests catch them (under an hour)'
	@echo 'make mutants-auto  set up, then change 200 places drawn at random and see that tests notice (under 90 minutes)'
	@echo 'make docs    set up, then build the documentation into docs/_build/html'
	@echo 'make audit   set up, then look up vulnerabilities, hashes and licences of what is installed'
	@echo 'make release set up, then build and check wheels and sdists, and run the demo from the wheel in an empty environment'
	@echo 'make fuzz    set up, then damage 10,000 files of each format that SemGS reads (under an hour)'
	@echo 'make faults  set up, then kill and starve commands while they write (under an hour)'
	@echo 'make check   formats, lints and types'
	@echo 'make format  bring the code into its format'

setup: $(STAMP)

# The scripts of a .venv that was copied or moved here still call the one it was, and its Python may have been uninstalled.
ifneq ($(shell $(BIN)/python -c '' 2>/dev/null && cat $(STAMP) 2>/dev/null),$(CURDIR))
$(STAMP): anew
endif

# The pip that comes with Python 3.11 takes more than twice as long as a newer one.
# setuptools builds yattag, which has no wheel; the one that comes with Python 3.11 is too old for it.
$(STAMP): pyproject.toml packages/semgs-rooms/pyproject.toml constraints.txt
	@test -n '$(PYTHON)' || { echo 'semgs needs Python 3.11 or newer; name one: make setup PYTHON=/path/to/python3' >&2; exit 2; }
	@if [ -e $(UNFINISHED) ] || { [ -e $(STAMP) ] && [ "$$(cat $(STAMP))" != '$(CURDIR)' ]; } \
		|| ! $(BIN)/python -m pip --version >/dev/null 2>&1; then rm -rf .venv; fi
	@rm -f $(STAMP)
	@mkdir -p .venv && touch $(UNFINISHED)
	@[ -x $(BIN)/python ] || $(PYTHON) -m venv .venv
	$(PIP) pip hatchling editables setuptools
	$(PIP) --no-build-isolation -e '.[sfm,objects,mesh,simulation,rerun,ros,usd,exr,phone,raycast,train,onnx,litert,segment,video,viewer,figures,docs,mutants,dev]' -e packages/semgs-rooms
	@rm -f $(UNFINISHED) && printf '%s' '$(CURDIR)' > $(STAMP)

demo: setup
	$(BIN)/semgs demo --html

$(APP): $(STAMP)
	$(PIP) --no-build-isolation -e '.[app]'
	@touch $(APP)

app: setup $(APP)
	$(BIN)/semgs app

# Some of their files are for other versions of Python.
$(COMPILED): $(STAMP)
	@cd .venv/lib/python3*/site-packages \
		&& ../../../bin/python -m compileall -qq -j 0 \
		numpy scipy sympy numba llvmlite torch sklearn matplotlib \
		torchmetrics networkx huggingface_hub rerun onnxscript beartype trimesh mpmath hypothesis _pytest coverage || true
	@touch $(COMPILED)

test: setup $(APP) $(COMPILED)
	OMP_NUM_THREADS=1 $(BIN)/pytest -n auto --maxprocesses 4 --dist loadfile -m 'not long and not gpu'
	$(MAKE) docs

# Warnings are errors: a link that leads nowhere, a page in no table of contents, a docstring that cannot be read.
docs: setup
	$(BIN)/sphinx-build -q -W --keep-going -j auto -b html docs docs/_build/html

$(CLUSTER): $(STAMP)
	$(PIP) --no-build-isolation -e '.[cluster]'
	@touch $(CLUSTER)

$(NODE_PROGRAMS): tests/node/package.json tests/node/package-lock.json
	@if command -v npm >/dev/null; then npm ci --prefix tests/node --ignore-scripts --no-audit --no-fund && touch $@; fi

long: setup $(CLUSTER) $(NODE_PROGRAMS) $(APP)
	CHECK_TYPES=1 $(BIN)/pytest -m 'long'

gpu: setup
	PYTHON='$(CURDIR)/$(BIN)/python' scripts/gpu.sh test

bench: setup
	$(BIN)/python -m paper.bench --json bench.json

mutants: setup
	$(BIN)/python tests/mutants.py

mutants-auto: setup
	$(BIN)/python tests/mutants_auto.py $(MUTANTS)

audit: setup
	$(PIP) pip-audit uv
	$(BIN)/python -m paper.release audit --lock build/requirements.lock

release: setup
	$(PIP) build twine 'readme_renderer[md]'
	scripts/release.sh

fuzz: setup
	PYTHONPATH=tests:tests/support $(BIN)/python -m fuzz $(FUZZ)

faults: setup
	PYTHONPATH=.:tests:tests/support $(BIN)/python -m faults $(FAULTS)

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
