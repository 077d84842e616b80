# make test: set up and run the quick tests, in a fresh clone with the Python of PYTHON=python3.13, say.
# make test-slow: the others, which are marked `slow` or `alone`. make test-all: every test, as CI does.
# make test-lowest: every test with the lowest versions that pyproject.toml allows, in an environment of its own.
# make test-newest: every test with the newest versions that it allows, in another (3 GB where torch is for CUDA).
# make dance [SONG=song.mp3] [DB=rep.h5]: set up and dance.
PYTHON ?= python3
BIN := .venv/bin
SONG ?= $(shell $(BIN)/choreograph songs --path house)
DB ?=
MINUTES ?= 5
SEED ?=
# Modules are compiled once and kept, not in each of the some hundred processes that tests start.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup docs test test-slow test-all test-lowest test-newest fuzz lint dance starter faults benchmark format

setup: .venv/.ready

.venv/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[test]'
	touch .venv/.ready

.venv/.docs-ready: .venv/.ready
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch .venv/.docs-ready

test: setup
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow and not alone"

test-slow: setup
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "slow and not alone"
	$(BIN)/pytest -m alone tests/view

test-all: setup
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not alone"
	$(BIN)/pytest -m alone tests/view

test-lowest:
	$(PYTHON) -m venv .venv-lowest
	$(PYTHON) .ci/lowest.py > .venv-lowest/lowest.txt
	.venv-lowest/bin/pip install --quiet --constraint .venv-lowest/lowest.txt --editable '.[test]'
	.venv-lowest/bin/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not alone"

test-newest:
	$(PYTHON) -m venv .venv-newest
	.venv-newest/bin/pip install --quiet --upgrade --upgrade-strategy eager --editable '.[test]'
	.venv-newest/bin/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not alone"

# Sane, damaged and hostile files of every format, for as long as wanted; what fails goes to tests/fuzz/corpus.
fuzz: setup
	cd tests && OMP_NUM_THREADS=1 ../$(BIN)/python -m fuzz --minutes $(MINUTES) $(if $(SEED),--seed $(SEED))

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The site, in build/docs: open build/docs/index.html.
docs: .venv/.docs-ready
	$(BIN)/sphinx-build -W --keep-going docs build/docs

dance: setup
	$(BIN)/choreograph dance "$(SONG)" $(if $(DB),--db "$(DB)")

# Renders the built-in takes and songs and rebuilds the built-in repertoire.
starter: setup
	$(BIN)/python -m content.starter_songs
	$(BIN)/python -m content.starter

# Kills every kind of long work at random moments, and lets it run into a full disk: a quarter of an hour.
faults: setup
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONPATH=tests $(BIN)/python -m faults.run_faults

# Prints times, and writes the page of ratios and stages.
benchmark: setup
	$(BIN)/pytest --benchmark-only tests/benchmarks
	OMP_NUM_THREADS=1 $(BIN)/python tests/benchmarks/page.py -o research/results/speed.md
