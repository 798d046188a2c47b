# Two commands do everything on a fresh machine (Python 3.11+, make, git): `make demo` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUN := $(VENV)/.run
READY := $(VENV)/.ready
# What is installed is what requirements/ has, by version and hash: wheels only, so that nothing is built but robochoc
# itself, by the locked build backend. `make lock` writes it: docs/guides/testing.md. For the demo, pip neither looks for
# what the lock already has, nor compiles what may never be imported: this halves its time.
PIP := pip install --disable-pip-version-check
LOCKED := --require-hashes --only-binary :all: -r requirements/build.txt -r

# Some machines set this variable. Then each program that a test starts would compile all imported modules again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo demo-11 docs docs-version test quick test-more test-slow test-all test-part compiled test-compiled coverage fuzz simulate mutate lint type format bench benchmark-set leaderboard journals lock sbom release audit nox test-newest clean

$(RUN): pyproject.toml requirements/build.txt requirements/run.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "robochoc needs Python 3.11 or newer; say: make PYTHON=python3.12 ..."; exit 1; }
	@echo "Installing robochoc into $(VENV): about 300 MB, a third of it Java for the solver ACE. This takes half a minute."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/$(PIP) --quiet --no-deps --no-compile $(LOCKED) requirements/run.txt
	$(BIN)/$(PIP) --quiet --no-index --no-deps --no-build-isolation --editable .
	@touch $@

$(READY): $(RUN) requirements/dev.txt
	@echo "Adding the development tools to $(VENV): about 430 MB more. This takes a minute."
	$(BIN)/$(PIP) --quiet $(LOCKED) requirements/dev.txt
	@touch $@

demo: $(RUN)  ## robochoc demo: 16 robots, no solution, the others fly: out/queens3d-4.html
	@mkdir -p out
	@$(BIN)/robochoc demo --html out/queens3d-4.html --no-open

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
	$(PYTEST) $(if $(SHUFFLE),--random-order --random-order-seed=$(SHUFFLE))

# What it can miss: docs/guides/testing.md.
BASE ?= main
MOST ?= 40
quick: $(READY)  ## the tests nearest to a change, by imports
	$(BIN)/python -m tests.support.quick --base $(BASE) --most $(MOST) -n $(JOBS)

# New random problems each time; a failure names the seed, and `make test-slow SEED=...` repeats it.
ifndef SEED
SEED := $(shell date +%s)
endif
test-slow: $(READY)  ## the rest: random batches in length, faults in all variants
	@echo "seed $(SEED): make test-slow SEED=$(SEED) draws the same examples"
	$(PYTEST) -m 'slow or (hypothesis and not more)' --hypothesis-profile=new --hypothesis-seed=$(SEED)

# Browsers, machines in networks of their own, vehicles, and other whole programs. The seed draws new random problems.
test-more: $(READY)  ## whole programs: pages in a browser, networks, vehicles
	@echo "seed $(SEED): make test-more SEED=$(SEED) draws the same examples"
	$(PYTEST) -m '(more or fresh) and not slow' --hypothesis-profile=fresh --hypothesis-seed=$(SEED)

test-all: test test-more test-slow

# One of PART slow tests, the same ones with the same problems each time. CI runs PART=64.
PART ?= 16
test-part: $(READY)  ## a fixed part of the slow tests
	$(PYTEST) -m slow -p tests.support.parts --part $(PART)

# A wheel with compiled modules, in an environment of its own that has what `make test` has. An editable install is always
# plain Python: a compiled module would stand in for a source that has been edited since.
COMPILED := $(VENV)/compiled
WHEEL := out/compiled/wheel
$(COMPILED)/.ready: requirements/build.txt requirements/dev.txt
	$(PYTHON) -m venv $(COMPILED)
	$(COMPILED)/bin/$(PIP) --quiet $(LOCKED) requirements/dev.txt
	@touch $@

compiled: $(COMPILED)/.ready  ## robochoc with compiled modules: .venv/compiled/bin/robochoc
	@rm -rf $(WHEEL)
	ROBOCHOC_COMPILE=1 $(COMPILED)/bin/pip wheel --quiet --no-index --no-deps --no-build-isolation -w $(WHEEL) .
	$(COMPILED)/bin/pip install --quiet --no-index --no-deps --force-reinstall $(WHEEL)/*.whl
	$(COMPILED)/bin/robochoc --version | grep compiled

# The tests stand in a folder without the sources, so that what is imported is what the wheel has installed.
APART := out/compiled/tests
# Of some folders the files that name a compiled module: solvers and links are the same from any wheel.
ABOUT_COMPILED ?= tests/protocols tests/unit/solver tests/unit/communication tests/unit/replay
CORE := tests/unit/system/test_compiled_core.py
ON_BOTH ?= tests/conformance tests/cli/test_local_signals.py $(CORE)
ON_PURE ?= tests/unit/communication/test_simulator.py tests/protocols/test_abt.py $(CORE)
PYTHON_APART = $(abspath $(COMPILED))/bin/python
PYTEST_APART = $(PYTHON_APART) -m pytest -n $(JOBS) --dist worksteal
test-compiled: compiled  ## the same answers from compiled modules, and from the same wheel with ROBOCHOC_PURE=1
	@rm -rf $(APART) && mkdir -p $(APART)
	@cp -r benchmarks docs instances requirements tests xsd *.md *.toml *.yml Makefile $(APART)
	cd $(APART) && files=$$($(PYTHON_APART) -m tests.support.compiled $(ABOUT_COMPILED)) && $(PYTEST_APART) $(ON_BOTH) $$files
	cd $(APART) && ROBOCHOC_PURE=1 $(PYTEST_APART) $(ON_PURE)
	@rm -rf $(APART)

# TESTS="tests/protocols" measures what some of the tests reach. Left out: signals that meet Python's own start, which is
# when coverage.py starts as well, and it swallows them. What is killed while it writes its data spoils them: a warning.
TESTS ?= tests
COVERAGE := $(BIN)/coverage
coverage: $(READY)  ## lines and branches that make test reaches, by package: out/coverage/packages.txt, out/coverage/html
	rm -rf out/coverage
	$(COVERAGE) run -m pytest -n $(JOBS) --dist worksteal $(TESTS) \
		--deselect tests/unit/communication/test_faults.py::test_a_signal_before_the_program_has_begun \
		--deselect tests/cli/test_local_signals.py::test_a_signal_at_the_start; \
	tests=$$?; PYTHONWARNINGS=ignore $(COVERAGE) combine --quiet && rm -f out/coverage/data.* && \
	$(COVERAGE) json --quiet && $(COVERAGE) html --quiet && \
	$(BIN)/python -m tests.support.coverage_by_package out/coverage/coverage.json >out/coverage/packages.txt; \
	table=$$?; cat out/coverage/packages.txt; exit $$((tests | table))

DOCS := $(VENV)/.docs
$(DOCS): $(READY) requirements/docs.txt
	$(BIN)/$(PIP) --quiet $(LOCKED) requirements/docs.txt
	@touch $@

# --strict: a broken link, anchor or reference ends the build.
# The theme says when its maintenance ends: docs/explanation/design/dependencies.md.
docs: $(DOCS)  ## the documentation site: out/site/index.html, readable without a network
	@mkdir -p out && rm -f out/site.built && touch out/site.begun
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@mv out/site.begun out/site.built

# One of several versions, with a selector: a commit of the branch gh-pages, which the workflow `release` pushes.
DOCS_VERSION ?= $(basename $(VERSION)) latest
MIKE = PATH="$(abspath $(BIN)):$$PATH" NO_MKDOCS_2_WARNING=1 mike
docs-version: $(DOCS)  ## this version of the site, 1.0 of 1.0.0, into the branch gh-pages; pushes nothing
	$(MIKE) deploy --update-aliases $(DOCS_VERSION)
	$(MIKE) set-default latest

# Findings are kept in out/fuzz. A seed repeats what the loop did; a kept input is tried again by
# .venv/bin/python -m tests.fuzz --target NAME FILE
SECONDS ?= 600
fuzz: $(READY)  ## spoilt inputs for all that reads them: make fuzz SECONDS=600 SEED=1 ENGINE=loop
	$(BIN)/python -m tests.fuzz --seconds $(SECONDS) --seed $(SEED) $(if $(ENGINE),--engine $(ENGINE))

# One seed decides a run. Findings are minimised and kept in out/simulate; each file contains the command that repeats it.
simulate: $(READY)  ## whole runs with faults in virtual time: make simulate SECONDS=600 SEED=1 [COUNT=1]
	$(BIN)/python -m tests.simulation --seconds $(SECONDS) --seed $(SEED) --jobs $(JOBS) $(if $(filter command%,$(origin COUNT)),--count $(COUNT))

# The first run records which tests reach which function. Survivors are shown; all results: out/mutation/results.jsonl
COUNT ?= 100
# BY_KILLER=1 asks which of `check`, `simulate` and the kinds of tests notice changes of protocols, hosts and quiescence.
mutate: $(READY)  ## all packages, changed in one place each: do the tests notice? make mutate SEED=1 COUNT=100 FILES=...
	$(BIN)/python -m tests.mutation$(if $(BY_KILLER),.by_killer) --count $(COUNT) --seed $(SEED) --jobs $(JOBS) $(FILES)

# Tools in an environment of their own: their versions and the project's cannot be in each other's way.
TOOLS := $(VENV)/tools
$(TOOLS)/.ready: requirements/build.txt requirements/tools.txt
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/$(PIP) --quiet $(LOCKED) requirements/tools.txt
	@touch $@

# Workflows, issue forms and CITATION.cff by their schemas; workflows also for what makes them unsafe.
CHECK = $(TOOLS)/bin/check-jsonschema --quiet --builtin-schema
lint: $(READY) $(TOOLS)/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(CHECK) vendor.github-workflows .github/workflows/*.yml
	$(CHECK) vendor.github-issue-forms .github/ISSUE_TEMPLATE/bug.yml .github/ISSUE_TEMPLATE/protocol.yml
	$(CHECK) vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(CHECK) vendor.dependabot .github/dependabot.yml
	$(CHECK) vendor.citation-file-format CITATION.cff
	$(TOOLS)/bin/zizmor --offline --quiet .github
	@git ls-files 'robochoc/*.py' | xargs wc -l | awk '$$1 > 700 && $$2 != "total" {print "warning: " $$2 " has " $$1 " lines: does it have one subject?"}'

type: $(READY)
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The long parts (peers, peers_costs, network, sniffer) are not among them, and their sections stay as they are:
# .venv/bin/python benchmarks/run.py --write peers peers_costs network sniffer. Nor are the studies: benchmarks/run.py --help names them.
bench: $(READY)  ## figures into benchmarks/RESULTS.md
	$(BIN)/python benchmarks/run.py

# The same list each time: the digests of all instances, and their optima, each proved by two solvers.
benchmark-set: $(READY)  ## robochoc/leaderboard/instances.json: some minutes of CPU
	$(BIN)/python -m robochoc.leaderboard.certificates robochoc/leaderboard/instances.json

# OF="--size small" takes a part of the set; BUDGET, ENTRANTS and JOBS change the rest.
ENTRANTS ?= dpop sfb atwb maxsum dsa mgm2 mcs-mgm gdba afc-ng dba
BUDGET ?= messages=20000,time=600
OF ?=
leaderboard: $(READY)  ## protocols on the benchmark set: out/leaderboard/results.json, out/leaderboard/site/index.html
	@mkdir -p out/leaderboard
	$(BIN)/robochoc leaderboard run $(ENTRANTS) --budget $(BUDGET) $(OF) --jobs $(JOBS) -o out/leaderboard/results.json
	$(BIN)/robochoc leaderboard show out/leaderboard/results.json --html out/leaderboard/site

journals: $(READY)  ## rewrite the golden journals: a changed one is a changed protocol
	$(BIN)/python -m tests.support.golden

# Versions stay where they still fit pyproject.toml; NEWEST=1 takes the newest. The index is not written down: it is the
# one that uv is set to here. docs.txt has most, and the others keep to its versions.
LOCK = $(TOOLS)/bin/uv pip compile pyproject.toml --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-emit-find-links --no-header --annotation-style line $(if $(NEWEST),--upgrade)
lock: $(TOOLS)/.ready  ## requirements/*.txt from pyproject.toml: make lock NEWEST=1
	$(LOCK) --extra dev --extra docs -o requirements/docs.txt
	$(LOCK) --extra dev -c requirements/docs.txt -o requirements/dev.txt
	$(LOCK) --extra network --extra ros -c requirements/dev.txt -o requirements/extras.txt
	$(LOCK) -c requirements/dev.txt -o requirements/run.txt
	$(subst pyproject.toml,,$(LOCK)) --group build -c requirements/dev.txt -o requirements/build.txt
	$(subst pyproject.toml,,$(LOCK)) --group tools -c requirements/build.txt -o requirements/tools.txt

# An environment that has nothing else says licences and what needs what, which a lock does not.
VERSION = $(shell sed -n 's/^__version__ = "\(.*\)"/\1/p' robochoc/__init__.py)
sbom: $(TOOLS)/.ready  ## what robochoc consists of, with its extras network and ros, in CycloneDX: out/sbom.cdx.json
	@mkdir -p out && rm -rf $(VENV)/sbom
	@$(PYTHON) -m venv --without-pip $(VENV)/sbom
	@$(TOOLS)/bin/uv pip install --quiet --python $(VENV)/sbom/bin/python --require-hashes --no-build -r requirements/extras.txt
	@sed 's/^dynamic = .*/version = "$(VERSION)"/' pyproject.toml >$(VENV)/sbom/pyproject.toml
	@$(TOOLS)/bin/cyclonedx-py environment --pyproject $(VENV)/sbom/pyproject.toml --output-reproducible -o out/sbom.cdx.json $(VENV)/sbom
	@rm -rf $(VENV)/sbom
	@echo out/sbom.cdx.json

# hatchling and mypyc are those of the compiled core's environment.
release: $(TOOLS)/.ready $(COMPILED)/.ready sbom  ## sdist and wheels, checked and tried, and the SBOM: out/release; publishes nothing
	PYTHONPATH=. $(COMPILED)/bin/python -m tests.support.release --tools $(TOOLS)/bin --sbom out/sbom.cdx.json -o out/release

audit: $(TOOLS)/.ready  ## known vulnerabilities of what is locked, as PyPI's service knows them
	@$(PYTHON) tests/support/audit.py $(TOOLS)/bin/pip-audit requirements/*.txt

nox: $(TOOLS)/.ready  ## tests and types with each Python that is there, 3.11 to 3.14
	$(TOOLS)/bin/nox

test-newest: $(TOOLS)/.ready  ## a part of the tests, with the newest of what pyproject.toml allows
	$(TOOLS)/bin/nox -s newest

clean:
	rm -rf $(VENV) out dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
