# `make demo` and `make test` do all the set-up on a machine that has python3 (>= 3.11, with venv) and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.installed
DEV := $(VENV)/.installed-dev
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# One more than two cores: some tests wait for clocks and processes.
JOBS ?= 3

.PHONY: demo test lint bench study docs clean

$(RUN): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -e .
	touch $@

$(DEV): $(RUN)
	$(PIP) -e '.[dev,cluster,browser,logs]'
	touch $@

demo: $(RUN)
	@mkdir -p out
	@$(BIN)/syncline-design check specs/uav_corridor.yaml --output html:out/uav_corridor.html
	@echo "HTML report: $(CURDIR)/out/uav_corridor.html"

test: lint
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/syncline-design catalog check

# Side by side with peers, as ratios in one run.
bench: $(DEV)
	$(PIP) -e '.[bench]'
	$(BIN)/python benchmarks/startup.py
	$(BIN)/python benchmarks/whole_process.py
	$(BIN)/python benchmarks/choice.py
	$(BIN)/python benchmarks/simulate.py
	$(BIN)/python benchmarks/diagnose.py
	$(BIN)/python benchmarks/study.py
	$(BIN)/python -m benchmarks.timing

# The full study of the diagnosis on hidden-world logs; resumes where it was stopped.
study: $(DEV)
	$(BIN)/python -m benchmarks.study_diagnosis --write docs/study.md

docs: $(DEV)
	$(PIP) -e '.[docs]'
	$(BIN)/mkdocs build --strict
	$(BIN)/python -m pytest -q tests/test_requirements_tools.py

clean:
	rm -rf $(VENV) out build dist
