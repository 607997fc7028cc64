# `make demo` and `make test` work on a fresh clone: they build the environment first. ARGS is passed on, as in
# `make test ARGS='-k homography -x'`.

SHELL := /bin/bash
VENV ?= .venv
# An interpreter of 3.11 to 3.13; unless given that of the environment there is, or else the newest that is found.
PYTHON ?=
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
.PHONY: help venv demo test coverage lint format bench fuzz damage kills docs clean

help:  ## List the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | column -t -s '|'

venv: $(STAMP)  ## Create or update the environment in .venv

# A name on the path is not enough: it may be a version manager's, for a version that is not chosen, and Debian has
# interpreters that cannot create environments.
SUITABLE := import ensurepip, sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))

$(STAMP): pyproject.toml constraints.txt
	@suitable() { "$$1" -c '$(SUITABLE)' 2>/dev/null; }; \
	if [ -z '$(PYTHON)' ] && suitable '$(BIN)/python'; then exit; fi; \
	clear=$$([ ! -e '$(VENV)/pyvenv.cfg' ] || echo --clear); \
	for python in $(or $(PYTHON:%='%'),python3.13 python3.12 python3.11 python3); do \
	    if suitable "$$python"; then \
	        echo "$(VENV): $$("$$python" -V), $$python"; \
	        exec "$$python" -m venv $$clear '$(VENV)'; \
	    fi; \
	done; \
	if [ -n '$(PYTHON)' ]; then \
	    echo "'$(PYTHON)' is not Python 3.11, 3.12 or 3.13, or cannot create environments (Debian and Ubuntu: apt-get" \
	        "install python3-venv). Name another, or none to take what is there" >&2; \
	    exit 1; \
	fi; \
	if command -v uv >/dev/null; then exec uv venv --quiet --seed --python 3.13 $$clear '$(VENV)'; fi; \
	echo "handsight needs Python 3.11, 3.12 or 3.13 with its venv module, and there is none. Install one (Debian and" \
	    "Ubuntu: apt-get install python3 python3-venv) or uv, or name one: make venv PYTHON=/path/to/python3.13" >&2; \
	exit 1
	'$(BIN)/pip' install --quiet --disable-pip-version-check --no-deps $(TORCH_INDEX:%=--extra-index-url '%') \
	    -c constraints.txt torch
	'$(BIN)/pip' install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch '$@'

demo: venv  ## Collect, train, servo and show: results in demo/
	'$(BIN)/handsight' demo --out demo $(ARGS)

test: venv  ## Run the tests
	$(PYTEST) $(ARGS)

coverage: venv  ## Run the tests and print how much of each room they ran
	rm -f build/coverage.json .coverage .coverage.*
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

fuzz: venv  ## Try spoilt input on every parser; ARGS='--inputs 2250 --jobs 2 --seed 3'
	'$(BIN)/python' tests/support/fuzz.py $(ARGS)

damage: venv  ## Damage stored files one by one, and see that each is found; ARGS='--mutations 200 --seed 1'
	'$(BIN)/python' tests/support/damage.py $(ARGS)

kills: venv  ## Kill every command that writes, and run it again; ARGS='--kills 1000 --seed 3'
	'$(BIN)/python' tests/support/kills.py $(ARGS)

docs: venv  ## Check links, commands and targets quoted in the documents
	'$(BIN)/pytest' tests/layout/test_docs.py $(ARGS)

clean:  ## Remove caches and builds; the environment and demo/ stay
	rm -rf .coverage build dist .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -path './$(VENV)' -prune -o -name __pycache__ -type d -print0 | xargs -0 rm -rf
