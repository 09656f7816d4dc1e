# Every target sets up what it needs in .venv; PYTHON must be 3.11 or newer.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt
SPHINX := $(BIN)/sphinx-build --quiet --jobs 2 --fail-on-warning --doctree-dir docs/_build/doctrees \
	docs docs/_build/html

.PHONY: run test test-slow fuzz check docs format clean

run: .venv/installed-base  ## five policies through the paper's fields and 100 others
	$(BIN)/ferguson evaluate --policy shortest --policy guided --policy multi-start \
		--policy single-start --policy best --fields paper:1-4 \
		--fields standard/validation:200-299 --out results/first --workers 2 --fresh

# kernels are compiled once, before two processes need them at once
test: .venv/installed-dev  ## the tests, without those that need minutes, and their coverage
	$(BIN)/python -c "from agents.policies.warm_up import warm; warm('multi-start'), warm('guided')"
	$(BIN)/pytest -n 2 --dist loadfile --cov --cov-report=

test-slow: .venv/installed-dev  ## the tests that need minutes
	$(BIN)/pytest -m slow --timeout 7200

fuzz: .venv/installed-dev  ## a quarter of a million odd cases: seven minutes
	$(BIN)/pytest tests/fuzz -n 2 --dist loadfile --hypothesis-profile large --timeout 14400

check: .venv/installed-dev docs  ## style, types, the import contract, spelling, and whether the pages build
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

# pages of modules that have moved stay behind and warn: if so, once more from scratch
docs: .venv/installed-docs  ## the pages, docs/_build/html/index.html; a warning is an error
	$(SPHINX) || { rm -rf docs/_build docs/reference/generated; $(SPHINX) || { rm -rf docs/_build; exit 1; }; }

format: .venv/installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf .venv results build dist docs/_build docs/reference/generated .mypy_cache .ruff_cache .pytest_cache .hypothesis .coverage

.venv/installed-base: pyproject.toml constraints.txt | .venv/bin/python
	$(PIP) --editable .
	touch $@

.venv/installed-dev: pyproject.toml constraints.txt | .venv/bin/python
	$(PIP) --editable '.[dev,agents,cluster,demos,maps,peers]'
	touch $@ .venv/installed-base

.venv/installed-docs: pyproject.toml constraints.txt | .venv/bin/python
	$(PIP) --editable '.[docs,agents,demos,peers]'
	touch $@ .venv/installed-base

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; say which: make PYTHON=python3.11"; exit 1; }
	$(PYTHON) -m venv .venv
