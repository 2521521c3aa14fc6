# Every target sets up .venv by itself. `make demo` is the main job; `make test` runs all tests;
# `make docs` builds the site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Pictures are drawn without a display (EGL); without OpenGL the report says so in one line.
export MUJOCO_GL ?= egl

.PHONY: demo install quick test nightly lowest attack check reproduce evidence demonstrations docs lerobot clean

demo: $(VENV)/.core
	$(BIN)/prior-reinforce demo --out runs/demo $(ARGS)

# What `demo` needs; `. .venv/bin/activate` then has `prior-reinforce`. The computer beside the arm
# needs less: `pip install .` brings neither torch nor MuJoCo.
install: $(VENV)/.core

# Three processes share the tests on two cores: of four, simulated arms stop for want of time.
# Bytecode is kept, or every program that a test starts would compile the package again.
# `make test` is all but the nightly ones: attacks, simulated arms, browser, reproduction
# (tests/tiers.py).
PYTEST := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 3 --dist load --maxschedchunk 4
test: $(VENV)/.all $(VENV)/.lerobot
	$(PYTEST) -m "not nightly" $(ARGS)

nightly: $(VENV)/.all $(VENV)/.lerobot
	$(PYTEST) -m nightly $(ARGS)

# At most 0.1 s of processor time a test; while you work.
MOST ?= 0.1
quick: $(VENV)/.all
	$(PYTEST) -m quick --most $(MOST) tests $(ARGS)

# What reads files and asks models, with the lowest versions that pyproject.toml declares, in an
# environment of their own.
LOWEST := tests/arm/recordings/test_csv.py tests/arm/recordings/test_lerobot.py tests/arm/workspace/test_manifest.py tests/commands/test_vision.py tests/perception/test_vlm_client.py tests/perception/test_pictures.py tests/arm/console/test_view.py
lowest: $(VENV)/.lowest
	PYTHONPATH=src PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 $(VENV)/lowest/bin/python -m pytest -q -o filterwarnings=default $(LOWEST) $(ARGS)

# CASES generated attacks, one table by class; and a third as many streams that shake an arm.
CASES ?= 3000
attack: $(VENV)/.all
	$(BIN)/python -m tests.attacks.table $(CASES)
	$(BIN)/python -m tests.attacks.streams $$(($(CASES) / 3))
	$(BIN)/python -m tests.attacks.requests $$(($(CASES) / 3))

check: $(VENV)/.all
	$(BIN)/ruff format --check .
	$(BIN)/ruff check --no-cache .
	$(BIN)/mypy
	$(BIN)/lint-imports

reproduce: $(VENV)/.reproduction
	$(BIN)/python -m reproduction all --workers 2 $(ARGS)

# Tables, verdicts and pictures from the raw rows that are shipped; nothing is run.
evidence: $(VENV)/.reproduction
	$(BIN)/python -m reproduction all --from results --fill README.md reproduction/docs/evidence.md $(ARGS)

# The prior sets of our own tasks, made again where they are shipped: bit for bit on one kind of
# processor, to rounding on another.
demonstrations: $(VENV)/.reproduction
	for name in basketball so101 curling curling_round fishing; do $(BIN)/python -m reproduction.demonstrations.$$name $(ARGS) || exit; done

# Open site/index.html; it needs no server. A broken link or docstring is an error.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet $(ARGS)

# The exact versions of constraints.txt. `.core` is what `demo` needs; `.all` has every extra, in one
# call: each call looks at all that is installed anew.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
EXTRAS := diffusion,simulation,dev,vlm,lerobot,hdf5,ros,zarr,fr3,ur,console,camera,docs
$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.core: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) -c constraints.txt torch==2.13.0 -e '.[diffusion,simulation]'
	touch $@

$(VENV)/.all: pyproject.toml constraints.txt reproduction/pyproject.toml simulators/pyproject.toml | $(BIN)/python
	$(PIP) -c constraints.txt torch==2.13.0 -e '.[$(EXTRAS)]' -e 'reproduction[ray]' -e simulators
	$(PIP) --no-deps franka-sim==1.1.7
	touch $(VENV)/.core $(VENV)/.docs $@

# What stands in reproduction/, with the libraries of the methods that it compares.
$(VENV)/.reproduction: $(VENV)/.core reproduction/pyproject.toml
	$(PIP) -c constraints.txt -e '.[diffusion,simulation,vlm]' -e reproduction
	touch $@

# A Python with LeRobot, for the executor of that name: .venv/lerobot/python.
$(VENV)/.lerobot: lerobot.txt | $(BIN)/python
	rm -rf $(VENV)/lerobot
	$(PIP) --no-deps --target $(VENV)/lerobot -r lerobot.txt
	printf '#!/bin/sh\nPYTHONPATH="$(CURDIR)/$(VENV)/lerobot" exec "$(CURDIR)/$(BIN)/python" -W ignore "$$@"\n' > $(VENV)/lerobot/python
	chmod +x $(VENV)/lerobot/python
	touch $@

# Installed by the pip of the other one: to install its own takes 6 s.
LOWEST_PIP := $(BIN)/python -m pip --python $(VENV)/lowest/bin/python install --quiet --disable-pip-version-check
$(VENV)/.lowest: pyproject.toml | $(BIN)/python
	rm -rf $(VENV)/lowest && $(PYTHON) -m venv --without-pip $(VENV)/lowest
	$(LOWEST_PIP) packaging 'tomli; python_version < "3.11"'
	$(VENV)/lowest/bin/python -m tests.lowest > $(VENV)/lowest/pins.txt
	$(LOWEST_PIP) -r $(VENV)/lowest/pins.txt mujoco joblib threadpoolctl 'pytest>=9' hypothesis beartype 'pandas>=2.1' packaging httpx
	touch $@

$(VENV)/.docs: $(VENV)/.core
	$(PIP) -c constraints.txt -e '.[diffusion,simulation,docs]'
	touch $@

lerobot: $(VENV)/.core $(VENV)/.lerobot

clean:
	rm -rf $(VENV) runs site
