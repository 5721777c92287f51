# make workbook   run all notebooks, write figures, report and claims table
# make test       style, types, layers and the whole test suite
# make lab        JupyterLab in the workbook's environment
# make campaigns  the committed tables of many seeded runs, anew (hours; ARGS="NAME --runs-scale 0.1" for a part)
# make benchmarks speed against other tools (ARGS=--write puts dated results into data/measured)
# make clean      remove what can be made again (add ALL=1 to remove the environment as well)
#
# Needed beforehand: Python 3.11 or newer, git and make. Everything else goes into .venv.

PYTHON ?= python3
JOBS ?= 2
ARGS ?=

ifeq ($(OS),Windows_NT)
VENV_BIN := .venv/Scripts
else
VENV_BIN := .venv/bin
endif
PY := $(VENV_BIN)/python
STAMP := .venv/.stamp-$(shell cat environment.txt pyproject.toml | cksum | cut -d' ' -f1)

.PHONY: workbook test lab campaigns benchmarks clean environment

workbook: environment
	$(PY) -m pumplib workbook --jobs $(JOBS) $(ARGS)

test: environment
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy
	$(VENV_BIN)/lint-imports
	$(PY) -m pytest $(ARGS)

lab: environment
	$(PY) -m pumplib lab

campaigns: environment
	$(PY) -m pumplib campaign --workers $(JOBS) $(ARGS)

benchmarks: environment
	$(PY) -m benchmarks $(ARGS)

clean:
	rm -rf build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis *.egg-info
	find pumplib tests benchmarks -name __pycache__ -type d -exec rm -rf {} +
	$(if $(ALL),rm -rf .venv)

environment: $(STAMP)

# The environment is made anew when the lock or the package's metadata changes.
# uv installs several times faster than pip; pip is enough when uv cannot be had.
# The package itself has no hash, so it comes in a second step.
$(STAMP): environment.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Python 3.11 or newer is needed; $(PYTHON) is $$($(PYTHON) --version 2>&1). Try: make PYTHON=python3.12 ..."; exit 1; }
	rm -f .venv/.stamp-*
	test -x $(PY) || $(PYTHON) -m venv .venv
	@if uv --version >/dev/null 2>&1; then \
	  installer="uv pip install --python $(PY)"; \
	elif $(PY) -m pip install --quiet --disable-pip-version-check uv; then \
	  installer="$(PY) -m uv pip install --python $(PY)"; \
	else \
	  installer="$(PY) -m pip install --disable-pip-version-check"; \
	fi; set -ex; \
	$$installer --require-hashes -r environment.txt; \
	$$installer --no-deps --no-build-isolation -e .
	touch $@
