# Everything runs in .venv, which the first target that needs it creates. Needed on the
# machine: make, and Python 3.11 or newer with pip. Override with `make test PYTHON=...`.

SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
.NOTPARALLEL:

export OPENBLAS_NUM_THREADS := 1# the matrices are small: more threads only wait
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_CONSTRAINT := constraints.txt
export UV_CONSTRAINT := constraints.txt
export PIP_BUILD_CONSTRAINT := constraints.txt

BIN := .venv/bin
USE := .venv/.stamp-use# hsp_control and what it needs are installed
STAMP := .venv/.stamp# what tests and development need, too
ENGINE := .venv/.engine# what is compiled is as new as its sources
WORKERS ?= 2# processes that `make test` uses
ARGS ?=# further arguments of pytest, as in `make test ARGS="-k spline"`

##@ Use
help: ## list the targets
	@awk 'BEGIN { FS = ":.*## " } /^##@ / { printf "\n%s\n", substr($$0, 5) } \
	  /^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

# The bytecode of what these import is written, whatever the shell's settings: without it each
# later start takes longer, and tests start hundreds of processes.
demo without-python test test-system thorough docs wheel-test: export PYTHONDONTWRITEBYTECODE :=
# Without the field its terms weigh nothing: both runs log the same distance.
LOOK := --set 'title=The same hand path. Only one elbow avoids the ball.' \
  --set 'view.background="\#10171E"'
demo: $(USE) $(ENGINE) ## the paper's run, and a Panda under a ball, with and without its field
	@echo "Running paper/4_moving_obstacle ..."
	@$(BIN)/hsp run paper/4_moving_obstacle --out out/demo
	@$(BIN)/hsp plot out/demo/4_moving_obstacle.npz --out out/demo
	@echo "Running panda_obstacle, with its field and without ..."
	@$(BIN)/hsp run panda_obstacle --out out/demo $(LOOK)
	@mv out/demo/panda_obstacle.npz 'out/demo/with the field.npz'
	@$(BIN)/hsp run panda_obstacle --out out/demo $(LOOK) \
	  --set null_space.fields.0.weight=0 --set null_space.fields.1.weight=0
	@mv out/demo/panda_obstacle-*.npz out/demo/without.npz
	@$(BIN)/hsp export 'out/demo/with the field.npz' out/demo/without.npz \
	  --html out/demo/panda.html
	@echo
	@echo "Open out/demo/panda.html in a browser; the switch (or w) shows it with and without."
	@echo "Touch it: $(BIN)/hsp play panda"
	@echo "The paper's log and figures are in out/demo, too."

without-python: $(USE) $(ENGINE) ## a loop in C++ moves the simulated arm, both processes
	@$(BIN)/python examples/without_python/start.py --out out/without_python $(ARGS)

##@ Check
quick: $(STAMP) $(ENGINE) ## what to run after every edit: a minute of CPU
	@$(BIN)/python -m pytest tests/unit -m "not slow and not process and not browser" \
	  $(ARGS)

# Each process begins with its own files, and takes tests of another one when it has none.
SPREAD = -n $(WORKERS) --dist worksteal
test: $(STAMP) $(ENGINE) ## run the tests, but for those of test-system
	@$(BIN)/python -m pytest $(SPREAD) -m "not system" $(ARGS)

test-system: WORKERS := 3# they wait a third of the time, for processes and browsers
test-system: $(STAMP) $(ENGINE) ## run those of browsers, notebooks, processes and whole walks
	@$(BIN)/python -m pytest $(SPREAD) -m system $(ARGS)

thorough: assertions sanitize ## run the tests with more seeds, every configuration's page, some mutants
	@HSP_THOROUGH=1 $(BIN)/python -m pytest $(SPREAD) $(ARGS)
	@$(BIN)/python tools/mutants.py

# OpenBLAS, NumPy and glibc choose their code by the processor.
older: $(STAMP) $(ENGINE) ## `make test` as on an x86-64 without AVX and FMA
	@OPENBLAS_CORETYPE=Nehalem NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4" \
	  GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-AVX,-FMA \
	  $(BIN)/python -m pytest $(SPREAD) -m "not system" $(ARGS)

# What a library of the engine is built with, and the tests whose calls it then makes.
CALLS ?= tests/unit/engine tests/unit/law tests/unit/edge tests/unit/tasks tests/unit/null_space \
  tests/unit/constraints tests/unit/trajectories tests/unit/geometry tests/unit/robot \
  tests/unit/control tests/unit/frozen -m "not system and not process"
assertions: $(STAMP) $(ENGINE) ## those of the engine, with Eigen's assertions and no allocation
	@HSP_ENGINE=$$($(BIN)/python hatch_build.py Debug) \
	  $(BIN)/python -m pytest $(SPREAD) $(CALLS) $(ARGS)
	@HSP_THOROUGH=1 HSP_ENGINE=$$($(BIN)/python hatch_build.py Debug) \
	  $(BIN)/python -m pytest tests/unit/engine/test_misuse.py -m process

sanitize: $(STAMP) $(ENGINE) ## those of the engine, under AddressSanitizer and UBSan (needs g++)
	@HSP_ENGINE=$$($(BIN)/python hatch_build.py Sanitized) \
	  LD_PRELOAD="$$(g++ -print-file-name=libasan.so) $$(g++ -print-file-name=libstdc++.so.6)" \
	  ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 PYTHONMALLOC=malloc \
	  CC="gcc -fsanitize=address" CXX="g++ -fsanitize=address" \
	  $(BIN)/python -m pytest --capture=sys --timeout 1800 $(SPREAD) $(CALLS) $(ARGS)

lint: $(STAMP) $(ENGINE) ## ruff, mypy --strict, the layers of the architecture
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy --strict
	@$(BIN)/lint-imports

coverage: $(STAMP) $(ENGINE) ## run the tests, report the lines of Python not run
	@$(BIN)/python -m pytest -n $(WORKERS) --cov --cov-report=term $(ARGS)

bench: $(STAMP) $(ENGINE) ## compare with other controllers, in .venv-peers
	@if ! .venv-peers/bin/python -m pip --version > /dev/null 2>&1; then \
	  echo "Creating .venv-peers ..."; $(call new-venv,$(BIN)/python,.venv-peers); \
	fi
	@.venv-peers/bin/python benchmarks/shared/install_peers.py
	@.venv-peers/bin/python -W "ignore:to-Python converter" benchmarks/side_by_side.py
	@.venv-peers/bin/python -W "ignore:to-Python converter" \
	  benchmarks/whole_body_side_by_side.py
	@for script in $(wildcard hsp_control/companions/walking/benchmark/walking_side_by_side.py); do \
	  .venv-peers/bin/python -W "ignore:to-Python converter" "$$script"; \
	done
	@.venv-peers/bin/python -W "ignore:to-Python converter" benchmarks/limit_side_by_side.py
	@.venv-peers/bin/python -W "ignore:to-Python converter" benchmarks/scaling.py

fuzz: $(STAMP) $(ENGINE) ## random states, mutated files, faults, soak: hours
	@PYTHONPATH=tests:tests/support nice $(BIN)/python -m campaigns $(ARGS)

mutants: $(STAMP) $(ENGINE) ## break the code at random, print the share that the tests detect
	@$(BIN)/python tools/mutants.py $(ARGS)

wheel: $(STAMP) $(ENGINE) ## build the wheel into dist/
	@rm -rf dist; env -u PIP_BUILD_CONSTRAINT \
	  $(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation \
	  --wheel-dir dist .
	@ls dist

sims: $(STAMP) $(ENGINE) ## robosuite's own arms and our law in them, in .venv-sims
	@if ! .venv-sims/bin/python -m pip --version > /dev/null 2>&1; then \
	  $(call new-venv,$(BIN)/python,.venv-sims); fi
	@.venv-sims/bin/python hsp_control/companions/simulators/tests/in_robosuite.py $(ARGS)

lerobot: $(STAMP) $(ENGINE) ## LeRobot's own commands on our arm, in .venv-lerobot (8 GB)
	@if ! .venv-lerobot/bin/python -m pip --version > /dev/null 2>&1; then \
	  $(call new-venv,$(BIN)/python,.venv-lerobot); fi
	@.venv-lerobot/bin/python tools/lerobot.py $(ARGS)

release: export CXX := zig
release: wheel ## a wheel for any Linux, the sources with their tests; check what PyPI shows
	@dir=$$(mktemp -d); trap 'rm -rf "$$dir"' EXIT; \
	$(call new-venv,$(BIN)/python,"$$dir"); \
	"$$dir/bin/python" -m pip install --quiet build twine; \
	"$$dir/bin/python" -m build --sdist --outdir dist . > /dev/null; \
	"$$dir/bin/python" -m twine check --strict dist/*

wheel-test: wheel ## build the wheel, install it elsewhere, use it from there
	@dir=$$(mktemp -d); trap 'rm -rf "$$dir"' EXIT; mkdir "$$dir/cwd"; \
	echo "Installing the wheel into a fresh environment ..."; \
	if command -v uv > /dev/null; then \
	  uv venv --quiet --python $(BIN)/python "$$dir/venv"; \
	  uv pip install --quiet --python "$$dir/venv/bin/python" dist/*.whl; \
	else \
	  $(call new-venv,$(BIN)/python,"$$dir/venv"); \
	  "$$dir/venv/bin/python" -m pip install --quiet dist/*.whl; \
	fi; \
	cd "$$dir/cwd"; export PATH="$$dir/venv/bin:$$PATH"; unset PYTHONPATH; \
	hsp robots; \
	hsp check paper/4_moving_obstacle; \
	hsp run paper/4_moving_obstacle --set simulation.duration=1 --out out; \
	hsp export out/4_moving_obstacle-*.npz --html out/page.html; \
	echo "The wheel works."

##@ Documents
REPLAYS ?=# arguments of tools/replays.py, such as --brief
docs: $(STAMP) $(ENGINE) ## build the site into docs/_build/html, with its replays; warnings are errors
	@echo "Running what the site's frames play (a minute, once) ..."
	@$(BIN)/python tools/replays.py $(REPLAYS)
	@$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html
	@echo "The site is docs/_build/html/index.html"

links: $(STAMP) $(ENGINE) ## check the links to other sites (needs a network)
	@$(BIN)/python tools/replays.py
	@$(BIN)/sphinx-build -q -b linkcheck docs docs/_build/links

##@ Keep
figures: $(STAMP) $(ENGINE) ## draw the documents' figures anew, into docs/figures
	@$(BIN)/python docs/make_figures.py

animations: $(STAMP) $(ENGINE) ## film the README's animations anew, into docs/figures (needs Chromium)
	@$(BIN)/python docs/make_animations.py
	@$(BIN)/python docs/make_play_picture.py

example-pictures: $(STAMP) $(ENGINE) ## run every example and draw its picture, into docs/figures/examples (needs Chromium)
	@$(BIN)/python docs/make_example_pictures.py

notebooks: $(STAMP) $(ENGINE) ## run the notebooks and keep what they print and draw
	@$(BIN)/python tools/notebooks.py

format: $(STAMP) $(ENGINE) ## let ruff format the code and fix what it can
	@$(BIN)/ruff check --fix --quiet || true
	@$(BIN)/ruff format

constraints: ## refresh constraints.txt with the newest version of everything
	@$(find-python); dir=$$(mktemp -d); trap 'rm -rf "$$dir"' EXIT; \
	unset PIP_CONSTRAINT PIP_BUILD_CONSTRAINT; \
	echo "Resolving with $$python, without constraints ..."; \
	$(call new-venv,"$$python","$$dir"); \
	"$$dir/bin/python" -m pip install --quiet '.[test,dev]' uv \
	  $$(python hatch_build.py needs) cmake ninja ziglang; \
	sed '/^[^#]/d' constraints.txt > "$$dir/new"; \
	"$$dir/bin/python" -m pip list --format=freeze --exclude hsp_control --exclude pip \
	  --exclude setuptools --exclude wheel >> "$$dir/new"; \
	cp "$$dir/new" constraints.txt; echo "Wrote constraints.txt; now: make lint test"

clean: ## remove caches, builds and the demo's output; .venv stays
	@rm -rf build dist docs/_build docs/_static/replays docs/reference/generated out/demo .coverage .*_cache .hypothesis
	@find hsp_control tests -name __pycache__ -prune -exec rm -rf {} +

.PHONY: help assertions sanitize older docs links figures animations example-pictures notebooks demo quick sims lerobot test test-system thorough lint coverage fuzz mutants wheel wheel-test release format constraints clean

# ------------------------------------------------------------------- the environment

# One environment for everything, with two stamps: the demo needs the package alone. Made
# anew where it is missing or broken, brought up to date where pyproject.toml or
# constraints.txt is newer than the stamp. What the engine is built with is installed
# first: so it is built there, and again only where a source of it has changed.
$(USE): pyproject.toml constraints.txt
	@echo "Installing hsp_control into .venv (0.9 GB, once) ..."
	@$(call install,.[export])
	@touch $@ $(ENGINE)

$(STAMP): pyproject.toml constraints.txt
	@echo "Installing hsp_control, test and development tools into .venv (2.6 GB, once) ..."
	@$(call install,.[test$(,)dev])
	@touch $(USE) $@ $(ENGINE)

, := ,
# $(call install,.[extra,...]): this checkout with its extras, by uv where it is there, else
# by pip. An environment that is broken is made anew.
define install
$(install-needs); \
$$install --no-build-isolation --editable '$(1)'
endef

# An environment, and in it what the engine is built with: no more is needed to compile it.
.venv/.needs: pyproject.toml constraints.txt
	@echo "Installing what the engine is built with into .venv ..."
	@$(install-needs)
	@touch $@

define install-needs
$(find-python); \
if command -v uv > /dev/null; then \
  $(BIN)/python -c '' 2> /dev/null || uv venv --quiet --clear --seed --python "$$python" .venv; \
  install="uv pip install --quiet --python $(BIN)/python"; \
else \
  $(BIN)/python -m pip --version > /dev/null 2>&1 || { $(call new-venv,"$$python",.venv); }; \
  install="env -u PIP_BUILD_CONSTRAINT $(BIN)/python -m pip install --quiet"; \
fi; \
$$install $$("$$python" hatch_build.py needs)
endef

$(ENGINE): $(USE) hatch_build.py engine/CMakeLists.txt $(shell find engine -name '*.?pp')
	@$(BIN)/python hatch_build.py > /dev/null
	@touch $@

# Sets the shell variable `python`: PYTHON if given, else the newest one that will do. A
# candidate is run, not trusted: some are shims of versions that are not installed.
define find-python
python=; for candidate in $(if $(PYTHON),"$(PYTHON)",python3.14 python3.13 python3.12 python3.11 python3); do \
  if "$$candidate" -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' 2> /dev/null; \
  then python=$$candidate; break; fi; \
done; \
if [ -z "$$python" ]; then \
  echo "No Python 3.11 or newer with the module venv found$(if $(PYTHON), in PYTHON=$(PYTHON))." >&2; \
  echo "Install one, or name it: make PYTHON=/path/to/python3.12" >&2; exit 1; \
fi
endef

# $(call new-venv,python,folder): a new environment with pip in it. Debian's Python has no
# ensurepip unless python3-venv is installed; its pip can then fill the environment too.
define new-venv
if $(1) -c 'import ensurepip' 2> /dev/null; then \
  $(1) -m venv --clear $(2); \
elif $(1) -m pip --version > /dev/null 2>&1; then \
  $(1) -m venv --clear --without-pip $(2); \
  $(1) -m pip --python $(2)/bin/python install --quiet pip; \
else \
  echo "This Python has neither ensurepip nor pip: install python3-venv, or python3-pip." >&2; exit 1; \
fi
endef
