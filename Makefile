# Two commands do everything on a fresh machine (Python 3.11+, make, git): `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run
READY := $(VENV)/.ready
PIP := $(BIN)/pip install --disable-pip-version-check

.PHONY: demo demo-11 docs test test-slow test-all coverage fuzz mutate lint type format bench journals clean

$(RUN): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "robochoc needs Python 3.11 or newer; say: make PYTHON=python3.12 ..."; exit 1; }
	@echo "Installing robochoc into $(VENV): about 340 MB, a third of it Java for the solver ACE."
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	@touch $@

$(READY): $(RUN)
	@echo "Adding the development tools to $(VENV): about 430 MB more. This takes a minute."
	$(PIP) --quiet --editable '.[dev]'
	@touch $@

demo: $(RUN)  ## 16 robots, no solution, the others fly: out/queens3d-4.html
	@mkdir -p out
	$(BIN)/robochoc validate instances/
	$(BIN)/robochoc solve instances/queens3d-4 --withdraw --html out/queens3d-4.html

demo-11: $(RUN)  ## the flagship: 121 robots in 121 processes, planar and full
	@mkdir -p out
	@for model in planar full; do \
		$(BIN)/robochoc generate queens3d --n 11 --model $$model -o out/queens3d-11-$$model --force && \
		$(BIN)/robochoc solve out/queens3d-11-$$model --html out/queens3d-11-$$model.html || exit $$?; \
	done

# The same problems each time. SHUFFLE=7 runs the tests in an order drawn from 7: they must not depend on it.
JOBS ?= 2
PYTEST := $(BIN)/pytest -n $(JOBS) --dist worksteal
test: $(READY)  ## every rule, command and refusal, and one fault of each kind
	$(PYTEST) $(if $(SHUFFLE),--random-order-bucket=global --random-order-seed=$(SHUFFLE))

# New random problems each time; a failure names the seed, and `make test-slow SEED=...` repeats it.
ifndef SEED
SEED := $(shell date +%s)
endif
test-slow: $(READY)  ## the rest: random batches in length, faults in all variants
	@echo "seed $(SEED): make test-slow SEED=$(SEED) draws the same examples"
	$(PYTEST) -m 'slow or hypothesis' --hypothesis-profile=new --hypothesis-seed=$(SEED)

test-all: test test-slow

# TESTS="tests/protocols" measures what some of the tests reach. Left out: signals that meet Python's own start, which is
# when coverage.py starts as well, and it swallows them. What is killed while it writes its data spoils them: a warning.
TESTS ?= tests
COVERAGE := $(BIN)/coverage
coverage: $(READY)  ## lines and branches that make test reaches, by room: out/coverage/rooms.txt, out/coverage/html
	rm -rf out/coverage
	$(COVERAGE) run -m pytest -n $(JOBS) --dist worksteal $(TESTS) \
		--deselect tests/unit/communication/test_faults.py::test_a_signal_before_the_program_has_begun; \
	tests=$$?; PYTHONWARNINGS=ignore $(COVERAGE) combine --quiet && rm -f out/coverage/data.* && \
	$(COVERAGE) json --quiet && $(COVERAGE) html --quiet && \
	$(BIN)/python -m tests.support.coverage_by_room out/coverage/coverage.json >out/coverage/rooms.txt; \
	table=$$?; cat out/coverage/rooms.txt; exit $$((tests | table))

DOCS := $(VENV)/.docs
$(DOCS): $(READY)
	$(PIP) --quiet --editable '.[docs]'
	@touch $@

# --strict: a broken link, anchor or reference ends the build.
# The theme says when its maintenance ends: docs/explanation/design.md, "Dependencies".
docs: $(DOCS)  ## the documentation site: out/site/index.html, readable without a network
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Findings are kept in out/fuzz. A seed repeats what the loop did; a kept input is tried again by
# .venv/bin/python -m tests.fuzz --target NAME FILE
SECONDS ?= 600
fuzz: $(READY)  ## spoilt inputs for all that reads them: make fuzz SECONDS=600 SEED=1 ENGINE=loop
	$(BIN)/python -m tests.fuzz --seconds $(SECONDS) --seed $(SEED) $(if $(ENGINE),--engine $(ENGINE))

# What survives is shown; the same mutant again: .venv/bin/python -m tests.mutation --again PATH:NUMBER
COUNT ?= 100
mutate: $(READY)  ## the protocols, spoilt in one place each: do the tests notice? make mutate SEED=1 COUNT=100 FILES=...
	$(BIN)/python -m tests.mutation --count $(COUNT) --seed $(SEED) $(FILES)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

type: $(READY)
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The long parts (sweep, variants, dynamic: about 40 minutes of one core) are not among them, and their sections
# stay as they are: .venv/bin/python benchmarks/run.py --write sweep variants dynamic optimum local_search channels network
bench: $(READY)  ## figures into benchmarks/RESULTS.md
	$(BIN)/python benchmarks/run.py

journals: $(READY)  ## rewrite the golden journals: a changed one is a changed protocol
	$(BIN)/python -m tests.support.golden

clean:
	rm -rf $(VENV) out dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
