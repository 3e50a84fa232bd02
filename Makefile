# SPDX-License-Identifier: GPL-3.0-or-later
# `make help` lists what there is. Every target sets up what it needs.

# Frames and size of the turntable: small enough for two cores without a GPU. make turntable FRAMES=240 RESOLUTION=1920x1080
FRAMES ?= 96
RESOLUTION ?= 960x540
SAMPLES ?= 4
OUTPUT ?= output

PYTHON := .venv/bin/python

.DEFAULT_GOAL := help
.PHONY: help setup turntable test lint zip requirements clean

help: ## Show this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/\1|\2/p' $(MAKEFILE_LIST) | while IFS='|' read -r target text; do \
		printf '  make %-13s%s\n' "$$target" "$$text"; done

setup: ## System libraries, uv, Python 3.13 and the pinned packages, in .venv
	@scripts/setup.sh

turntable: setup ## Render the demonstration lake to output/turntable.mp4 and a contact sheet
	$(PYTHON) scripts/render.py -- --frames $(FRAMES) --resolution $(RESOLUTION) --samples $(SAMPLES) \
		--output $(OUTPUT)/turntable.mp4 --contact-sheet $(OUTPUT)/turntable.png

test: lint ## Lint, then run all tests
	$(PYTHON) -m pytest

lint: setup ## Style and likely mistakes
	$(PYTHON) -m ruff check .

zip: setup ## Build and validate the extension: build/lake_water-<version>.zip
	$(PYTHON) scripts/build_extension.py

requirements: setup ## Compile requirements.in and requirements-uv.in again, with every version and hash
	@PATH=".tools/bin:$$PATH" scripts/compile_requirements.sh

clean: ## Remove what was built and rendered (not the environment)
	rm -rf build output .pytest_cache .ruff_cache .hypothesis
	find lake_water_addon scripts tests -name __pycache__ -type d -prune -exec rm -rf {} +
