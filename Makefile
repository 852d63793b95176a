PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help ros2 demo test nightly lint format docs bench soak scale kills fuzz mutants clean

help:  ## list these targets
	@awk -F ':.*## ' '/^[a-z0-9]+:.*## / {printf "  make %-8s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(VENV)/.demo  ## simulate a small world, map it, localise a drive, write a report
	$(BIN)/omninav

# Small matrix products are many times slower with several threads on busy cores.
test: export OPENBLAS_NUM_THREADS = 1
test: lint  ## lint, then run every test
	-test -e .venv-ros2 || $(MAKE) --no-print-directory ros2
	$(BIN)/pytest -n 2 --dist loadfile

nightly: export OPENBLAS_NUM_THREADS = 1
nightly: $(VENV)/.installed  ## run the tests that `make test` leaves to the night
	$(BIN)/pytest -n 2 -m nightly

lint: $(VENV)/.installed  ## check style, types and the layers of the code
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.installed  ## format the code and mend what can be mended automatically
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: export NO_MKDOCS_2_WARNING = 1
docs: $(VENV)/.installed  ## build the documentation site: build/site/index.html
	@echo "running the tutorials and building the pages: some minutes (OMNINAV_EXECUTE=false: without running the tutorials)"
	$(BIN)/mkdocs build --quiet

bench: $(VENV)/.benchmarks  ## measure speed, beside other libraries
	$(BIN)/python benchmarks/run.py

soak: $(VENV)/.installed  ## drive 100,000 steps and check that memory and map stop growing
	$(BIN)/python benchmarks/soak.py

scale: $(VENV)/.installed  ## run 100,000 images, a million odometry messages, a map of 100,000 references
	$(BIN)/python benchmarks/scale.py images
	$(BIN)/python benchmarks/scale.py odometry
	$(BIN)/python benchmarks/scale.py references

kills: export KILLS := $(or $(KILLS),300)
kills: $(VENV)/.installed  ## kill and disturb runs KILLS times (300) and compare the bytes they end at
	$(BIN)/python tests/kills/campaign.py

SECONDS ?= 60
SEED ?= 1
fuzz: export OPENBLAS_NUM_THREADS = 1
fuzz: $(VENV)/.installed  ## read hostile inputs of every format on all cores (SECONDS=600 SEED=1)
	PYTHONPATH=tests $(BIN)/python -m hostile.fuzz --seconds $(SECONDS) --seed $(SEED)

mutants: $(VENV)/.mutants  ## try small slips in every folder, each night (MINUTES=10 of each, ONLY=stages/fusion)
	MINUTES=$(or $(MINUTES),10) tests/mutants/nightly.sh $(ONLY)

ros2: .venv-ros2/.installed  ## real rclpy, for live tests (Python 3.11)

clean:  ## remove the virtual environment and all build and check caches
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis

$(VENV)/.demo: pyproject.toml
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), "omninav needs Python 3.11: make PYTHON=python3.11 …"'
	@echo "installing into $(VENV): a minute or two"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

# The wheels of rclpy are for Python 3.11 alone; the tests' other end runs there, with nothing of ours.
.venv-ros2/.installed: pyproject.toml
	python3.11 -m venv .venv-ros2
	.venv-ros2/bin/python -m pip install --quiet --disable-pip-version-check 'ros-rclpy>=9.1' ros-rmw-fastrtps-cpp \
		ros-sensor-msgs ros-nav-msgs ros-geometry-msgs ros-std-srvs ros-diagnostic-msgs
	touch $@

$(VENV)/.installed: $(VENV)/.demo
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

$(VENV)/.mutants: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[mutants]'
	touch $@

# The library particles asks for numpy below 2, without need.
$(VENV)/.benchmarks: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps 'particles>=0.4'
	touch $@
