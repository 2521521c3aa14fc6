# Every target sets up .venv by itself. `make demo` is the main job; `make test` runs all tests;
# `make docs` builds the site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Pictures are drawn without a display (EGL); without OpenGL the report says so in one line.
export MUJOCO_GL ?= egl

.PHONY: demo install test attack check reproduce evidence demonstrations docs lerobot clean

demo: $(VENV)/.core
	$(BIN)/prior-reinforce demo --out runs/demo $(ARGS)

# What `demo` needs; `. .venv/bin/activate` then has `prior-reinforce`. The computer beside the arm
# needs less: `pip install .` brings neither torch nor MuJoCo.
install: $(VENV)/.core

# Three processes share the tests, the longest first: a third of the time of some is waiting.
# Bytecode is kept, or every program that a test starts would compile the package again.
test: $(VENV)/.all $(VENV)/.lerobot
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n 3 --dist load --maxschedchunk 4 $(ARGS)

# CASES generated attacks, one table by class; and a third as many streams that shake an arm.
CASES ?= 3000
attack: $(VENV)/.all
	$(BIN)/python -m tests.attacks.table $(CASES)
	$(BIN)/python -m tests.attacks.streams $$(($(CASES) / 3))

check: $(VENV)/.all
	$(BIN)/ruff format --check .
	$(BIN)/ruff check --no-cache .
	$(BIN)/mypy
	$(BIN)/lint-imports

reproduce: $(VENV)/.all
	$(BIN)/prior-reinforce reproduce all --workers 2 $(ARGS)

# Tables, verdicts and pictures from the raw rows that are shipped; nothing is run.
evidence: $(VENV)/.core
	$(BIN)/prior-reinforce reproduce all --from results --fill README.md docs/evidence.md $(ARGS)

# The prior sets of our own tasks, made again where they are shipped: bit for bit on one kind of
# processor, to rounding on another.
demonstrations: $(VENV)/.core
	for name in basketball so101 curling curling_round fishing; do $(BIN)/python -m demonstrations.$$name $(ARGS) || exit; done

# Open site/index.html; it needs no server. A broken link or docstring is an error.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet $(ARGS)

# The exact versions of constraints.txt. `.core` is what `demo` needs; `.all` adds every extra.
$(VENV)/.core: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt torch==2.13.0
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[diffusion,lab]'
	touch $@

$(VENV)/.all: $(VENV)/.core
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[diffusion,lab,dev,baselines,vlm,lerobot,hdf5,ros,zarr,excel,ray,fr3,ur,console,camera]'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps franka-sim==1.1.7
	touch $@

# A Python with LeRobot, for the executor of that name: .venv/lerobot/python.
$(VENV)/.lerobot: lerobot.txt $(VENV)/.core
	rm -rf $(VENV)/lerobot
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --target $(VENV)/lerobot -r lerobot.txt
	printf '#!/bin/sh\nPYTHONPATH="$(CURDIR)/$(VENV)/lerobot" exec "$(CURDIR)/$(BIN)/python" -W ignore "$$@"\n' > $(VENV)/lerobot/python
	chmod +x $(VENV)/lerobot/python
	touch $@

$(VENV)/.docs: $(VENV)/.core
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[diffusion,lab,docs]'
	touch $@

lerobot: $(VENV)/.lerobot

clean:
	rm -rf $(VENV) runs site
