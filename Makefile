# `make drive` and `make test` set everything up by themselves on a machine with Python 3.11-3.13.
PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || echo python3)
BIN := .venv/bin
READY := .venv/.ready
ARGS ?=

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MODEL := out/model

.PHONY: drive test tests lint style types docs coverage newest model baselines results clean
drive: $(READY)
	$(BIN)/caldrive drive --town town02 --weather 14 --task straight --route 4 --cars 15 --people 50 --cap 20 --out out/drive $(ARGS)

# Each of the two has a core of its own: more threads would only take turns. A file's tests stay together, so that what
# they share is made once.
PYTEST := OMP_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist loadfile

# What takes seconds comes first; then no core waits for a single process.
test: style
	$(MAKE) --no-print-directory --jobs 3 types docs tests

tests: $(READY)
	$(PYTEST) $(ARGS)

lint: style types

style: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python scripts/large_files.py

types: $(READY)
	$(BIN)/mypy

# The tests once more, and the share of the lines that they reach. Not a part of `test`: with Python 3.11 counting takes
# 40 % more time. From 3.12 on Python counts by itself (sys.monitoring).
coverage: $(READY)
	core=$$($(BIN)/python -c 'import sys; print("sysmon" if sys.version_info >= (3, 12) else "ctrace")'); \
	COVERAGE_CORE=$$core $(PYTEST) --cov --cov-report=term $(ARGS)
	rm -f .coverage*

# Every verb of the package with the newest libraries that pyproject.toml allows, in an environment of its own. PyTorch
# stays the pinned one, which may be a CPU build.
newest:
	rm -rf out/newest
	$(PYTHON) -m venv out/newest
	out/newest/bin/pip install --quiet --disable-pip-version-check "$$(grep '^torch==' constraints.txt)"
	out/newest/bin/pip install --quiet --disable-pip-version-check '.[explain,gym,hdf5,search,tune]'
	out/newest/bin/pip freeze
	out/newest/bin/python scripts/every_verb.py

# The pages in out/docs; a warning is an error. Nothing is fetched.
docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

# From nothing to a network like the one that the package ships; a run that was stopped goes on. The log keeps every step's time.
model: $(READY)
	@mkdir -p $(MODEL)
	@step() { echo "$$(date +%FT%T) caldrive $$*" | tee -a $(MODEL)/log.txt; $(BIN)/caldrive "$$@" | tee -a $(MODEL)/log.txt; }; \
	step collect --out $(MODEL)/recording --semantic; \
	step data $(MODEL)/recording --picture $(MODEL)/recording.png; \
	step train --data $(MODEL)/recording --out $(MODEL)/training; \
	step evaluate --data $(MODEL)/recording --model $(MODEL)/training/model.safetensors --held-out --worst $(MODEL)/worst.png; \
	step collect --out $(MODEL)/elsewhere --town town02 --weathers 4 14 --episodes 60 --cars 15 --people 50 --randomised 0; \
	step evaluate --data $(MODEL)/elsewhere --model $(MODEL)/training/model.safetensors; \
	step benchmark --suite quick --model $(MODEL)/training/model.safetensors --out $(MODEL)/quick; \
	echo "$$(date +%FT%T) done: $(MODEL)/training/model.safetensors" | tee -a $(MODEL)/log.txt

# The paper's other three systems from the recording that `make model` makes, too; a run that was stopped goes on.
baselines: $(READY)
	$(BIN)/caldrive collect --out $(MODEL)/recording --semantic
	$(BIN)/caldrive baselines --data $(MODEL)/recording --out out/baselines $(ARGS)

# All suites with all drivers, and in docs/results the report's tables and every episode's line (compressed), from which
# the tables follow again; the HTML reports stay in out/results. A run that was stopped goes on.
results: $(READY)
	$(BIN)/python -m scripts.drive_results $(ARGS)

# An environment that is there stays: it may hold PyTorch's CPU build, for the Python that it was made with. Bytecode is
# made on all cores, as pip would use one; a few files of libraries are no Python.
USED = $(or $(wildcard $(BIN)/python),$(PYTHON))
$(READY): pyproject.toml constraints.txt
	@$(USED) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || \
		{ echo "Found $$($(USED) --version), need Python 3.11 to 3.13: install one or run make PYTHON=/path/to/python3.11"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable '.[opendrive,docs,test]'
	$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib || true
	touch $(READY)

clean:
	rm -rf .venv out
