# make test: set up and run every test.   make dance SONG=song.mp3 DB=rep.h5: set up and dance.
PYTHON ?= python3
BIN := .venv/bin
SONG ?=
DB ?= rep.h5

.PHONY: setup test lint dance benchmark format

setup: .venv/.ready

.venv/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[test]'
	touch .venv/.ready

test: setup
	$(BIN)/pytest

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

dance: setup
	$(BIN)/choreograph dance $(SONG) --db $(DB)

benchmark: setup
	$(BIN)/pytest --benchmark-only tests/benchmarks
