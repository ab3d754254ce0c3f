# make setup | demo | test | lint | bench. Everything lives in .venv; nothing else is installed but libEGL.

VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed

.PHONY: setup demo test lint bench clean

setup: $(STAMP) libegl

# PYTHON may be set to another interpreter (3.11 or newer).
PYTHON ?= python3

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; try: make $(MAKECMDGOALS) PYTHON=python3.11"; exit 1; }
	test -x $(PY) || $(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

# Rendering needs the system's libEGL; everything else runs without it.
.PHONY: libegl
libegl:
	@$(PYTHON) -c 'import ctypes; ctypes.CDLL("libEGL.so.1")' 2>/dev/null && exit 0; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -qq && apt-get install -y -qq libegl1 >/dev/null; \
	else \
		echo "For pictures of the simulation, type: sudo apt-get install libegl1"; \
	fi

demo: setup
	$(VENV)/bin/cogarch run "make a ham sandwich" --scene simple --backend drake

test: setup
	$(PY) -m pytest -n 2 --dist loadfile

lint: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

bench: setup
	$(PY) benchmarks/run.py
	$(PY) -m benchmarks.planner
	$(PY) -m benchmarks.perception --quick
	$(PY) -m benchmarks.sweep
	$(PY) -m benchmarks.affordances

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache
