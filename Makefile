# volviz: every target sets up what it needs. `make` alone lists them.
SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# Two processes, whatever the machine: each draws and extracts with threads of its own.
SIDE_BY_SIDE := --numprocesses 2 --dist worksteal
PACKAGES := libegl1 libgl1-mesa-dri libgl1 libglx-mesa0 xvfb xauth libx11-6 libxrandr2 libxinerama1 libxcursor1 libxi6

.PHONY: help demo test test-all lint bench system clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

demo: $(STAMP) ## draw an embedded sample to demo.png and say which OpenGL drew it
	$(BIN)/volviz render sample:ct-head --azimuth 30 --elevation 10 --size 800x600 --force -o demo.png
	@echo "The picture is $(CURDIR)/demo.png"
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ]; then echo "and the same in a window"; \
	  $(BIN)/volviz view sample:ct-head --azimuth 30 --elevation 10; fi

test: lint $(VENV)/.test ## lint, types and the tests (under 15 minutes on two cores)
	$(BIN)/python -m pytest $(SIDE_BY_SIDE) -m "not slow"

test-all: lint $(VENV)/.test ## the same with the slow sweeps
	$(BIN)/python -m pytest $(SIDE_BY_SIDE)

lint: $(VENV)/.test ## ruff and mypy
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

bench: $(VENV)/.bench ## volviz beside its peers; prints ratios (RESULTS.md keeps them)
	$(BIN)/python -m tests.bench
	$(BIN)/python -m tests.bench surfaces
	$(BIN)/python -m tests.bench latency

# System packages: installed when root (or with sudo that asks nothing), else the line to run is printed.
system:
	@missing=""; \
	for p in $(PACKAGES) python3-venv; do \
	  [ $$p = python3-venv ] && $(PYTHON) -c 'import ensurepip' 2>/dev/null && continue; \
	  dpkg-query -W -f='$${Status}' $$p 2>/dev/null | grep -q 'install ok installed' || missing="$$missing $$p"; \
	done; \
	if [ -z "$$missing" ] || ! command -v apt-get >/dev/null; then exit 0; fi; \
	if [ "$$(id -u)" = 0 ]; then run=""; \
	elif sudo -n true 2>/dev/null; then run="sudo"; \
	else echo "volviz needs system packages. Run:  sudo apt-get install -y$$missing" >&2; exit 0; fi; \
	echo "installing$$missing"; \
	export DEBIAN_FRONTEND=noninteractive; \
	{ $$run apt-get install -y --no-install-recommends $$missing \
	  || { $$run apt-get update && $$run apt-get install -y --no-install-recommends $$missing; }; } >/tmp/volviz-apt.log 2>&1 \
	|| { cat /tmp/volviz-apt.log >&2; echo "could not install:$$missing" >&2; exit 1; }

$(BIN)/python:
	@$(MAKE) --no-print-directory system
	@$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11)' \
	  || { echo "volviz needs Python 3.11 or newer; give one: make PYTHON=python3.12 …" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(STAMP): pyproject.toml | $(BIN)/python
	@$(MAKE) --no-print-directory system
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.test: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[codecs,test,lint]'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[peers]' \
	  || echo "VTK and scikit-image could not be installed: the tests that set volviz beside them skip" >&2
	@touch $@

$(VENV)/.bench: $(VENV)/.test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

clean: ## remove what the targets made
	rm -rf $(VENV) build dist demo.png .mypy_cache .ruff_cache .pytest_cache
