# One file for people and machines: `make demo`, `make test`, `make bench`. Each target sets up what it is missing.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# stamps live in the environment that they speak of, so that deleting it forgets them, too
STAMP := $(VENV)/stamps
RUST_FILES := $(shell find src shaders -type f) $(wildcard build.rs)
PYTEST ?= $(BIN)/pytest

# Scenes that cannot be part of this repository; tests that want them are the only ones that may be skipped.
ifndef MIPLIGHT_SCENES
  ifneq ($(wildcard ../shared/scenes/.),)
    export MIPLIGHT_SCENES := $(abspath ../shared/scenes)
  endif
endif

.PHONY: help
help: ## Show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

.PHONY: setup
setup: $(STAMP)/system $(STAMP)/extension ## Make .venv, a Vulkan driver if there is none, and the extension

.PHONY: demo
demo: setup ## Render Spot in a room and a colonnade of half a million triangles
	$(BIN)/miplight demo --out out/demo

.PHONY: test
test: lint test-rust test-python ## Lints, types, Rust tests, Python tests

.PHONY: lint
lint: setup ## Formatting, lints and types (clippy comes with test-rust)
	cargo fmt --check
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

# `cargo clippy` would check every dependency a second time, for minutes. Its driver is a compiler as well, so the
# same lints run here while this crate alone is compiled, on dependencies that the builds share.
CLIPPY := RUSTC_WORKSPACE_WRAPPER="$$(rustc --print sysroot)/bin/clippy-driver" CLIPPY_ARGS=-Dwarnings

.PHONY: test-rust
test-rust: $(STAMP)/system $(STAMP)/extension ## Clippy and the Rust tests
	$(CLIPPY) cargo build --release --features python --config 'profile.release.package.miplight.opt-level=0'
	$(CLIPPY) cargo test --release --no-run
	$(CLIPPY) cargo test --release

.PHONY: test-python
test-python: setup $(STAMP)/browser ## The Python tests
	$(PYTEST)

.PHONY: stress
stress: setup ## The stress suite with more of everything; docs/stability.md says what it tries
	MIPLIGHT_STRESS=long $(PYTEST) tests/stress --timeout 1800

.PHONY: bench
bench: setup ## Measure passes, rays, errors and Mitsuba; writes benches/results
	$(BIN)/python benches/run.py

.PHONY: bench-claims
bench-claims: setup ## Hold the claims about direct light against Mitsuba and brute force; writes benches/results
	$(BIN)/python benches/claims.py --sizes 256 512 1024 --write

.PHONY: bench-area
bench-area: setup ## Hold paper C's preset against its bounds; writes benches/results
	$(BIN)/python benches/area2010.py

.PHONY: bench-area-2016
bench-area-2016: setup ## Hold paper D's preset against its bounds; writes benches/results
	$(BIN)/python benches/area2016.py

.PHONY: bench-virtual-lights
bench-virtual-lights: setup ## Hold the presets of papers A and B against their bounds; writes benches/results
	$(BIN)/python benches/virtual_lights.py

.PHONY: bench-one-bounce
bench-one-bounce: setup ## Hold direct light and one bounce by the default against Mitsuba and other methods; writes benches/results
	$(BIN)/python benches/one_bounce.py --write

.PHONY: bench-lpv
bench-lpv: setup ## Measure propagation volumes, and other methods at equal time; writes benches/results
	$(BIN)/python benches/lpv.py

.PHONY: bench-gpu
bench-gpu: setup ## The same on a GPU, without Mitsuba
	$(BIN)/python benches/run.py --adapter gpu --no-mitsuba

.PHONY: bench-compare
bench-compare: setup ## What got slower or less accurate: make bench-compare OLD=a.json NEW=b.json
	$(BIN)/python benches/compare.py $(OLD) $(NEW)

# The tag says on which machines a wheel runs; maturin finds the oldest C library that does. `WHEEL_TAG=manylinux_2_28`
# asks for one, and fails where this machine's is too new for it; `WHEEL_FLAGS=--zig` (pip install ziglang) builds for
# older ones than its own.
WHEEL_TAG ?=
WHEEL_FLAGS ?=

.PHONY: wheel
wheel: $(STAMP)/venv ## Build a wheel for every Python from 3.10 on into dist, and try it in a clean environment
	rm -f dist/*.whl
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin build --release --locked --strip --auditwheel repair --out dist \
		$(if $(WHEEL_TAG),--compatibility $(WHEEL_TAG)) $(WHEEL_FLAGS)
	$(BIN)/python tools/try_wheel.py dist/*.whl

.PHONY: pictures
pictures: setup ## Make the pictures and times of docs/method.md
	$(BIN)/python docs/make_pictures.py

.PHONY: clean
clean: ## Remove what was built
	rm -rf target $(VENV) out dist tests/failures python/miplight/_core*.so .mypy_cache .ruff_cache .pytest_cache

$(STAMP)/venv:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "maturin>=1.9,<2"
	mkdir -p $(STAMP) && touch $@

# A Vulkan driver for the renderer, an LLVM for Mitsuba.
$(STAMP)/system: $(STAMP)/venv tools/ensure_system.sh
	bash tools/ensure_system.sh
	touch $@

# A browser without a screen, for the tests of the live view.
$(STAMP)/browser: $(STAMP)/venv tools/ensure_system.sh
	bash tools/ensure_system.sh browser
	touch $@

# maturin also installs the packages that pyproject.toml names
$(STAMP)/extension: $(STAMP)/venv pyproject.toml Cargo.toml Cargo.lock $(RUST_FILES)
	@command -v cargo >/dev/null || { echo "Rust is missing: install rustc and cargo 1.89 or newer" >&2; exit 1; }
	PIP_QUIET=1 VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --locked --extras dev,mitsuba,notebook,test
	touch $@
