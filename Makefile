# The whole project in two commands: make run, make test. Needs Python 3.11 or later (PYTHON=python3.12 make run).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
UV := uv==0.13.9

.DEFAULT_GOAL := help
.PHONY: help run setup compile test check format bench lock clean distclean

help:
	@echo 'make run     install into $(VENV) and serve the page, the 3D scene and the API on http://127.0.0.1:8000'
	@echo 'make test    run all tests (PYTEST_ARGS="-m '"'not slow'"'" for the quick ones)'
	@echo 'make check   ruff and mypy'
	@echo 'make setup   install what the tests need; make compile also compiles the solver'
	@echo 'make format  format the code'
	@echo 'make bench   measure the predictor on the reference cases'
	@echo 'make lock    resolve the locked requirements again'
	@echo 'make clean   remove caches and builds; make distclean also removes $(VENV)'

run: $(VENV)/.run-installed
	$(BIN)/dlo serve

setup: $(VENV)/.dev-installed

compile: $(VENV)/.dev-installed
	@echo 'Compiling; this takes some minutes the first time.'
	$(BIN)/python -c 'import dlocore; dlocore.warm_up()'

test: compile
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null || \
		echo 'No Chromium found: the browser tests will be skipped.'
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder $(PYTEST_ARGS)

check: $(VENV)/.dev-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.dev-installed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# one thread: for problems of this size, the threads of a linear algebra library only cost time
bench: $(VENV)/.dev-installed
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.paper_case

# both files serve every Python from 3.11 on and every system; they have no index addresses, which are up to the user
lock: $(VENV)/.dev-installed
	$(PIP) install --quiet $(UV)
	$(BIN)/uv pip compile --universal --python-version 3.11 --custom-compile-command 'make lock' \
		--quiet --upgrade pyproject.toml --output-file requirements.lock
	$(BIN)/uv pip compile --universal --python-version 3.11 --custom-compile-command 'make lock' \
		--quiet --upgrade --extra plots --group dev --constraint requirements.lock \
		pyproject.toml --output-file requirements-dev.lock

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "dlo needs Python 3.11 or later: PYTHON=python3.12 make")'
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# install what a lock file names, and the project itself: with uv in a third of the time, or with pip if uv is not available
define install
	@echo 'Installing into $(VENV); this may take a minute or two the first time.'
	{ $(PIP) install --quiet $(UV) && \
		$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --requirement $(1) --editable .; } || \
		$(PIP) install --quiet --requirement $(1) --editable .
	@touch $@
endef

# the installation runs again only if the locks or pyproject.toml change
$(VENV)/.run-installed: requirements.lock pyproject.toml | $(BIN)/python
	$(call install,requirements.lock)

$(VENV)/.dev-installed: requirements-dev.lock pyproject.toml | $(BIN)/python
	$(call install,requirements-dev.lock)

clean:
	rm -rf build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name $(VENV) -prune -o -type d -name __pycache__ -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
