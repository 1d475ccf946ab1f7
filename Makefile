# Plain `make` lists the commands. Everything lives in .venv; nothing outside this folder is needed but Python ≥ 3.11.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

.DEFAULT_GOAL := help
.PHONY: help setup run test lint soak bench example-adsb example-irregular clean

help: ## list the commands
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-18s %s\n", $$1, $$2}'

setup: $(READY) ## make the environment in .venv and compile the kernels

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lsu-mesh needs Python 3.11 or newer; try make PYTHON=python3.12")'
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@echo "installing into .venv …"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[record,ros2,gateway,mcap,dev]"
	@echo "compiling the kernels …"
	@$(BIN)/python -m lsu_mesh.filters.warm_up
	@touch $(READY)

run: $(READY) ## run the demo: three sensors, three filters, a fusion, a recorder
	@$(BIN)/lsu-mesh run

test: $(READY) lint ## lint, type check, and all tests that take less than ten minutes together
	@sh tests/install_viewer_packages.sh
	$(BIN)/python -m pytest -q -n logical --dist loadfile -m "not (soak or live or viewer or alone)"
	$(BIN)/python -m pytest -q -m "(live or viewer or alone) and not soak"

lint: $(READY) ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

soak: $(READY) ## the heavy checks at full size (hours)
	$(BIN)/python -m pytest -q -m soak
	$(BIN)/python -m pytest -q -n logical --dist loadfile --hypothesis-profile=new -m "not (soak or live or viewer or alone)"

bench: $(READY) ## speed of filters and hulls beside other libraries, as ratios
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[bench,plots]"
	@$(BIN)/lsu-mesh bench kernels

example-adsb: $(READY) ## the altitude of a real aircraft through the mesh
	@$(BIN)/python examples/adsb/run.py

example-irregular: $(READY) ## a car whose reports come at any moment, at their times and on the nearest step
	@$(BIN)/python examples/irregular/run.py

clean: ## remove the environment, caches and recordings
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis runs build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
