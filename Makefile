# Each goal makes .venv and installs what it needs, and again only when the lists of packages change.
PYTHON ?= python3
ONLY ?=
SCALE ?= smoke
DEVICE ?= cpu

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet install --no-compile -c constraints.txt
RUN := $(VENV)/installed-run
DEV := $(VENV)/installed-dev

# Packages are compiled to bytecode as they are imported. Where that may not be kept every process does it anew, 2 s
# of each command and each worker.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := install
.PHONY: install demo test check bench plan clean

install: $(DEV)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "fgnav needs Python 3.11 or newer; call make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(RUN): pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) --editable .
	@touch $@

$(DEV): pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) --editable '.[dev]'
	@touch $(RUN) $@

# The flight of the source paper by three methods, then what each kind of factor is worth.
demo: $(RUN)
	rm -rf demo
	$(BIN)/fgnav demo demo
	$(BIN)/fgnav compare demo/flight --noise nominal --integers lambda --factors gravity --method smoother \
	  --without baselines,gravity,line-of-sight,vehicle --json demo/worth.json

# Notebooks run whole, one after another: what the first compiles, a minute or three of it, the others and the tests
# find. Warnings of their kernel's own machinery aside. Then two workers: more gain nothing on a small machine, nor do
# threads of theirs. Each keeps to neighbouring files, whose flights are solved once, until it helps the other.
test: $(DEV)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -W default --timeout=1200 --nbmake --nbmake-timeout=1200 notebooks
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

check: $(DEV)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	@set -e; for notebook in notebooks/*.ipynb; do \
	  if grep -q '"output_type"' $$notebook; then echo "$$notebook: strip its outputs"; exit 1; fi; \
	  $(BIN)/jupytext --quiet --to py:percent --output - $$notebook | diff $${notebook%.ipynb}.py - || \
	  { echo "$$notebook and its .py differ: jupytext --sync $$notebook"; exit 1; }; done

bench: $(DEV)
	$(BIN)/python -m tests.benchmarks $(ONLY)

# What training each recipe would cost: two steps of every network, timed. make plan SCALE=paper DEVICE=cuda
plan: $(DEV)
	@set -e; for recipe in models/fgnav_models/recipes/*.toml; do echo "$$recipe"; \
	  $(BIN)/fgnav train $$recipe --plan --scale $(SCALE) --device $(DEVICE) --out $$(mktemp -d); done

clean:
	rm -rf $(VENV) demo bench.json yardstick.json build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
