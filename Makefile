# `make demo` and `make test` work on a fresh clone: they build the environment first. ARGS is passed on, as in
# `make test ARGS='-k homography -x'`.

SHELL := /bin/bash
VENV ?= .venv
PYTHON ?= python3.11
# Where pip's own configuration offers no CPU build of torch it takes the default one, gigabytes of CUDA included.
# TORCH_INDEX=<PyTorch's index of CPU wheels> avoids that.
TORCH_INDEX ?=
ARGS ?=
# Files of tests are handed to so many processes: most tests wait for a disk, a server or a child. 0 is one, for pdb.
PROCESSES ?= 2

BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
PYTEST := '$(BIN)/pytest' --numprocesses $(PROCESSES) --dist loadfile

# The repository's root must never be on sys.path: its folder `datasets` would shadow a well-known package.
export PYTHONSAFEPATH := 1

.DEFAULT_GOAL := help
.PHONY: help venv demo test coverage lint format bench docs clean

help:  ## List the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | column -t -s '|'

venv: $(STAMP)  ## Create or update the environment in .venv

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null || { \
	    echo "handsight needs Python 3.11, and '$(PYTHON)' is not it. Install it (Debian and Ubuntu: apt-get install" \
	    "python3.11 python3.11-venv), or name it: make venv PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { \
	    echo "'$(PYTHON)' cannot create environments: install its venv module" \
	    "(Debian and Ubuntu: apt-get install python3.11-venv)" >&2; exit 1; }
	$(PYTHON) -m venv '$(VENV)'
	'$(BIN)/pip' install --quiet --disable-pip-version-check --no-deps $(TORCH_INDEX:%=--extra-index-url '%') \
	    -c constraints.txt torch
	'$(BIN)/pip' install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch '$@'

demo: venv  ## Collect, train, servo and show: results in demo/
	'$(BIN)/handsight' demo --out demo $(ARGS)

test: venv  ## Run the tests
	$(PYTEST) $(ARGS)

coverage: venv  ## Run the tests and print how much of each room they ran
	rm -f build/coverage.json
	$(PYTEST) --cov --cov-report=json:build/coverage.json $(ARGS); status=$$?; \
	    '$(BIN)/python' .ci/coverage_by_room.py build/coverage.json && exit $$status

lint: venv  ## Check style, types and the direction of imports
	'$(BIN)/ruff' check .
	'$(BIN)/ruff' format --check .
	'$(BIN)/mypy' -p handsight -p benchmarks
	'$(BIN)/mypy' tests
	'$(BIN)/lint-imports'

format: venv  ## Apply the formatter and the safe fixes
	'$(BIN)/ruff' format .
	'$(BIN)/ruff' check --fix .

bench: venv  ## Run every benchmark
	'$(BIN)/python' -m benchmarks all $(ARGS)

docs: venv  ## Check links, commands and targets quoted in the documents
	'$(BIN)/pytest' tests/layout/test_docs.py $(ARGS)

clean:  ## Remove caches and builds; the environment and demo/ stay
	rm -rf .coverage build dist .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -path './$(VENV)' -prune -o -name __pycache__ -type d -print0 | xargs -0 rm -rf
