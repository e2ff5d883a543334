# One command each; `make` lists them. VENV=... puts the environment elsewhere, PYTHON=... picks the interpreter.
VENV ?= .venv
PYTHON ?=
SCENARIO ?= bennu.yaml
KILLS ?= 200
RESULT ?= runs/$(basename $(notdir $(SCENARIO)))-reach-run.h5
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
RUN_STAMP := $(VENV)/.installed-run
DEV_STAMP := $(VENV)/.installed-dev
COMPILE := $(BIN)/pip-compile --quiet --upgrade --strip-extras --no-header --no-annotate --no-emit-options \
	--no-emit-index-url --no-emit-find-links --build-deps-for editable

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup run test check lint types smoke bench validate torture lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(DEV_STAMP) ## create the environment with everything that runs, tests and linters need

run: $(RUN_STAMP) ## find the reachable domain of Bennu: a table, a figure and an HDF5 file in runs/
	$(BIN)/reach run $(SCENARIO) -o $(RESULT)
	$(BIN)/landing results plot $(RESULT)
	@echo "Result: $(RESULT); look further with: $(BIN)/landing results show $(RESULT)"

test: $(DEV_STAMP) ## run the tests
	$(BIN)/python -m pytest -n auto --dist loadfile

check: lint types test ## lint, types and tests

lint: $(DEV_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(DEV_STAMP)
	$(BIN)/mypy

smoke: $(RUN_STAMP) ## one short real run, re-flown by another integrator
	@folder=$$(mktemp -d) && trap 'rm -rf "$$folder"' EXIT && \
	$(BIN)/reach run bennu.yaml --set 'reach.initial_states=[{name: north_pole, position_km: [0, 0, 0.8]}]' \
		--set reach.tof_s=700 -o "$$folder/smoke.h5" && \
	$(BIN)/landing results verify "$$folder/smoke.h5"

bench: $(DEV_STAMP) ## time the solvers against the usual ones on the same facets
	$(BIN)/python -m bench

torture: $(DEV_STAMP) ## kill real runs, fill disks, forge files; print what was tried and what passed
	$(BIN)/python tests/torture --kills $(KILLS) --workers 10

validate: $(DEV_STAMP) ## regenerate docs/validation.md and its figures
	$(BIN)/python docs/validate.py

lock: $(DEV_STAMP) ## pin the newest versions that pyproject.toml allows
	$(PIP) pip-tools
	$(COMPILE) -o $(VENV)/run.txt pyproject.toml
	$(COMPILE) --extra dev -c $(VENV)/run.txt -o $(VENV)/dev.txt pyproject.toml
	@for kind in run dev; do \
		file=requirements.lock; test $$kind = run || file=requirements-dev.lock; \
		grep '^#' $$file > $(VENV)/head.txt; cat $(VENV)/head.txt $(VENV)/$$kind.txt > $$file; \
	done

clean: ## remove the environment and caches (results stay)
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find landing_cli tests -name __pycache__ -type d -exec rm -rf {} +

$(BIN)/python:
	@for python in $(or $(PYTHON),python3.13 python3.12 python3.11 python3); do \
		if $$python -c 'import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' \
			>/dev/null 2>&1; then \
			echo "creating $(VENV) with $$($$python --version)"; exec $$python -m venv --clear $(VENV); \
		fi; \
	done; \
	echo "error: no Python 3.11, 3.12 or 3.13 with venv found (tried: $(or $(PYTHON),python3.13 python3.12 python3.11 python3));" \
		"install one (Debian: apt install python3 python3-venv) or name it: make PYTHON=/path/to/python3" >&2; exit 1

$(RUN_STAMP): requirements.lock pyproject.toml | $(BIN)/python
	@echo "installing the pinned versions into $(VENV)"
	$(PIP) --requirement requirements.lock
	$(PIP) --no-deps --no-build-isolation --editable .
	@touch $@

$(DEV_STAMP): requirements-dev.lock $(RUN_STAMP)
	$(PIP) --requirement requirements-dev.lock
	@touch $@
