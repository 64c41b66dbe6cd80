# Terragrip: `make demo` and `make test` each work alone on a fresh clone with Python 3.11+, make and a C compiler.
# Everything lives in .venv and build; nothing outside the clone is written or read, save pip's own configuration.
SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
# One thing after the other, but for what `beside` starts.
ifndef BESIDE
.NOTPARALLEL:
endif

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
WORKERS ?= 2
# PYTHON=... names the interpreter; otherwise the first of these that is 3.11 or newer.
PYTHON ?=
CANDIDATES := python3 python3.11 python3.12 python3.13 python3.14

# Byte code is kept even where the machine says not to: each of the hundreds of processes that tests start would compile the package anew.
unexport PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE
export PYTHONNOUSERSITE := 1

KERNEL_SOURCES := $(wildcard kernel/src/*.c)
KERNEL_HEADERS := $(wildcard kernel/include/*.h kernel/src/*.h kernel/tests/*.h)
KERNEL_TESTS := $(patsubst kernel/tests/%.c,%,$(wildcard kernel/tests/*.c))
BUILD_INPUTS := pyproject.toml setup.py cffi_build.py $(KERNEL_SOURCES) $(KERNEL_HEADERS) \
	$(wildcard kernel/python/*.[ch] src/terragrip/*/*.c src/terragrip/*/*.h)

.PHONY: beside-long browser-test pytest-long notebooks soak soak-short help demo test lint kernel-test web-test pytest studio wheel docs system bench lock clean sbom audit \
	kernel-aarch64 kernel-others test-long kernel-sanitized fuzz system-fuzz fuzz-kernel fuzz-kernel-run fuzz-parsers kills

help: ## show this list
	@sed -n 's/^\([a-z-]*\):[^#]*## /  make \1\t/p' $(MAKEFILE_LIST)

demo: $(VENV)/package studio ## set up, simulate the campaign, estimate every run, and say where the report is
	@$(BIN)/terragrip demo

test: ## set up, then lint, type checks, import rules, C tests and Python tests
	@$(MAKE) $(AT_ONCE) pytest lint kernel-test web-test

# Side by side, so that no processor waits for apt, pip, npm or a test's timer; four jobs, the longest way first. Each command's output in one piece.
AT_ONCE := --no-print-directory BESIDE=1 -j 4 $(if $(findstring output-sync,$(.FEATURES)),--output-sync=line)

# Every test file imported once after a change: else each worker of pytest would rewrite and compile all of them anew.
build/collected.txt: $(wildcard tests/*.py tests/*/*.py tests/*/*/*.py) pyproject.toml | $(VENV)/package $(VENV)/dev
	@mkdir -p build && $(BIN)/python -m pytest --collect-only -q > $@ || { tail -n 40 $@; exit 1; }

lint: $(VENV)/package $(VENV)/dev ## ruff, mypy and import-linter
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

# Real parts of some tests: a browser for the studio, a broker for the live service. Installed only by root on Debian; without them
# those tests say loudly that they were skipped (the whole chromium does too, at twice the processor time).
SYSTEM := chromium-headless-shell mosquitto openssl
system: ## as root on Debian: install the programs that the tests of studio and live service drive
	@missing=""; for name in $(SYSTEM); do PATH="$$PATH:/usr/sbin" command -v $$name >/dev/null 2>&1 || missing="$$missing $$name"; done; \
	if [ -n "$$missing" ] && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then \
	  echo "Installing$$missing for the tests"; \
	  { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $$missing; } >/dev/null 2>&1 \
	    || echo "make: could not install$$missing; tests that have no other will be skipped" >&2; \
	elif [ -n "$$missing" ]; then echo "make: without$$missing some tests are slower or skipped" >&2; fi

# Two workers a processor: only the tests of live service, fleet and studio wait for what takes no processor, and each more worker takes some 8 s of it for
# importing every test file, and then for what the tests of a room share. A worker takes a whole file, then the next in order,
# so that what a file's tests share is made once. The workers fill the processors: no threads inside a product of matrices.
PYTEST = OMP_NUM_THREADS=1 $(BIN)/python -m pytest --dist loadfile --no-loadscope-reorder -n
pytest: $(VENV)/package $(VENV)/dev build/collected.txt studio system ## the Python tests alone
	$(PYTEST) $(shell expr 2 \* $(WORKERS))

studio: $(VENV)/made ## build the studio's pages, where Node.js 20 or newer is
	@$(BIN)/python build_pages.py

wheel: $(VENV)/package studio ## a source distribution and, from it, an abi3 wheel with the studio's pages, in dist
	@$(BIN)/python build_pages.py --required
	@rm -rf dist && mkdir dist
	@$(BIN)/python -c "from setuptools import build_meta; build_meta.build_sdist('dist')" > build/sdist.log
	@CC="$(CC)" $(PIP) wheel --quiet --no-deps --no-build-isolation -w dist dist/*.tar.gz
	@ls -l dist

docs: $(VENV)/package $(VENV)/dev ## the documentation site, with the reference from the code, in build/docs
	@$(BIN)/python docs/site/make.py

web-test: studio ## the pages' own tests, where Node.js is
	@if [ -d web/node_modules ]; then cd web && npm run --silent test; else echo "SKIPPED: the tests of the pages need Node.js 20 or newer" >&2; fi

notebooks: $(VENV)/package $(VENV)/dev ## execute the example notebooks into build/notebooks
	@$(BIN)/python examples/notebooks.py

bench: $(VENV)/package $(VENV)/dev ## every benchmark: ratios against a peer in the same run
	@for script in benchmarks/bench_*.py; do echo "== $$script"; $(BIN)/python "$$script" || exit 1; done

mutants: $(VENV)/package $(VENV)/dev ## do the tests notice? 400 random changes of the Python, each tried by the tests of its line; about an hour
	@$(BIN)/python benchmarks/mutants.py --workers $(WORKERS)

lock: $(VENV)/made ## resolve the dependencies anew into requirements.lock and requirements-dev.lock
	$(PIP) install --quiet uv
	echo 'setuptools>=77' | $(BIN)/uv pip compile $(LOCK_FLAGS) --extra all pyproject.toml - -o requirements.lock
	echo pip | $(BIN)/uv pip compile $(LOCK_FLAGS) - -o requirements-pip.lock
	$(BIN)/uv pip compile $(LOCK_FLAGS) --extra dev -c requirements.lock pyproject.toml -o requirements-dev.lock
LOCK_FLAGS := --quiet --upgrade --generate-hashes --universal --python-version 3.11 --no-annotate --no-emit-index-url \
	--no-emit-find-links --fork-strategy fewest --custom-compile-command "make lock"

# Their tools are no part of the development environment: nothing else needs them.
$(VENV)-supply/made: $(VENV)/made
	@$(BIN)/python -m venv --clear $(VENV)-supply && $(VENV)-supply/bin/python -m pip --disable-pip-version-check --no-input install --quiet cyclonedx-bom pip-audit
	@touch $@

sbom: $(VENV)-supply/made ## what Terragrip stands on, as CycloneDX: dist/python.cdx.json and dist/pages.cdx.json
	@mkdir -p dist
	@$(VENV)-supply/bin/cyclonedx-py requirements requirements.lock --of JSON -o dist/python.cdx.json
	@if [ -d web/node_modules ]; then cd web && npm sbom --silent --sbom-format cyclonedx --omit dev > ../dist/pages.cdx.json; \
	else echo "SKIPPED: the pages' part needs Node.js; run make studio first" >&2; fi
	@ls -l dist/*.cdx.json

audit: $(VENV)-supply/made ## known vulnerabilities of the locked packages, where their data can be had
	@$(VENV)-supply/bin/pip-audit --disable-pip -r requirements.lock > build/audit.txt 2>&1; code=$$?; grep -v "could not be audited" build/audit.txt; \
	missed=$$(grep -c "could not be audited" build/audit.txt); \
	if [ "$$missed" != 0 ]; then echo "NOT AUDITED: $$missed packages, whose data could not be had from here" >&2; fi; exit $$code

clean: ## remove everything that was built or installed
	rm -rf $(VENV) $(VENV)-supply build dist web/node_modules src/terragrip/studio/static src/*.egg-info .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests -name __pycache__ -prune -exec rm -rf {} +
	rm -f src/terragrip/*.so src/terragrip/*/*.so src/terragrip/_kernel_*.py src/terragrip/simulation/_plant.py

# --- the environment -------------------------------------------------------------------------------------------------
# Each file below is a stamp: it is newer than what it was made from, so a second run does nothing. The pip that installs is a recent one:
# that of Python 3.11 takes twice the time. -qq: warnings are about indexes that lack a package, one for each.
$(VENV)/made:
	@python=""; for candidate in $(if $(PYTHON),$(PYTHON),$(CANDIDATES)); do \
	  if "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then python="$$candidate"; break; fi; \
	done; \
	if [ -z "$$python" ]; then \
	  echo "make: no Python 3.11 or newer among: $(if $(PYTHON),$(PYTHON),$(CANDIDATES)); install one, or name it: make PYTHON=/path/to/python3" >&2; exit 1; fi; \
	if ! "$$python" -c 'import venv, ensurepip' >/dev/null 2>&1; then \
	  echo "make: $$python cannot make a virtual environment; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; fi; \
	if ! command -v $(CC) >/dev/null 2>&1; then \
	  echo "make: no C compiler named $(CC); on Debian and Ubuntu: apt-get install gcc libc6-dev, or name one: make CC=clang" >&2; exit 1; fi; \
	echo "Setting up $(VENV) with $$("$$python" -c 'import sys; print(sys.executable, sys.version.split()[0])')"; \
	"$$python" -m venv --clear $(VENV)
	@$(PIP) install -qq -r requirements-pip.lock || echo "make: pip stays as it came with Python, which is slower" >&2
	@$(BIN)/python -c 'import sys; print(sys._base_executable, sys.version)' > $@

# Byte code on two processors, as pip does it on one (nobody imports the few files that do not compile), without the packages' own tests.
$(VENV)/runtime: $(VENV)/made requirements.lock
	@echo "Installing the packages of requirements.lock"
	@$(PIP) install -qq --no-compile -r requirements.lock
	@$(BIN)/python -W ignore -m compileall -qq -j 2 -x '/tests?/' $(VENV)/lib || true
	@touch $@

# Beside the package, which the compiler is at for most of the time: both have what is in runtime already and add what the other does not.
$(VENV)/dev: $(VENV)/runtime requirements-dev.lock
	@echo "Installing the packages of requirements-dev.lock"
	@$(PIP) install -qq --no-compile -r requirements-dev.lock
	@touch $@

$(VENV)/package: $(VENV)/runtime $(BUILD_INPUTS)
	@echo "Compiling the kernel and installing terragrip into $(VENV)"
	@CC="$(CC)" $(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

# --- the kernel's own tests, in double and in single precision ---------------------------------------------------------
KERNEL_FLAGS := -std=c99 -O2 -Wno-psabi -Wall -Wextra -pedantic -Wconversion -Wdouble-promotion -Wshadow -Werror -Ikernel/include -Ikernel/src -Ikernel/tests

define kernel_rules
build/kernel/$(1)/%.o: kernel/src/%.c $$(KERNEL_HEADERS) Makefile
	@mkdir -p $$(@D)
	$$(CC) $$(KERNEL_FLAGS) $(2) -c -o $$@ $$<

build/kernel/$(1)/%: kernel/tests/%.c $$(patsubst kernel/src/%.c,build/kernel/$(1)/%.o,$$(KERNEL_SOURCES)) $$(KERNEL_HEADERS)
	@mkdir -p $$(@D)
	$$(CC) $$(KERNEL_FLAGS) $(2) -o $$@ $$(filter %.c %.o,$$^) -lm
endef
# `make test-long` runs all tests under the sanitizers.
SANITIZERS := -g1 -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all
.SECONDARY:
$(eval $(call kernel_rules,sanitized,-Og $(SANITIZERS)))
$(eval $(call kernel_rules,sanitized-float,-Og -DTG_FLOAT $(SANITIZERS)))
$(eval $(call kernel_rules,double,))
$(eval $(call kernel_rules,float,-DTG_FLOAT))

kernel-test: $(foreach real,double float,$(KERNEL_TESTS:%=build/kernel/$(real)/%)) ## compile the kernel with every warning an error, run its C tests
	@for program in $^; do echo "$$program"; ./$$program || exit 1; done

# --- what takes long: sanitizers, fuzzers, soak ---------------------------------------------------------------------------
FUZZ_SECONDS ?= 5
# of each of the four ways of writing
KILLS ?= 25
FUZZERS := $(patsubst fuzz/kernel/%.c,build/fuzz/kernel-%,$(wildcard fuzz/kernel/*.c))
FUZZ_CC := clang

test-long: beside-long kills soak-short ## every C test under the address and undefined-behaviour sanitizers, tests marked long, each fuzzer for FUZZ_SECONDS, a hundred kills, a soak of 60 s

beside-long:
	@$(MAKE) $(AT_ONCE) kernel-sanitized pytest-long fuzz

browser-test: $(VENV)/package $(VENV)/dev studio system ## every test of the pages in a browser: `make test` runs their main ways, `make test-long` the rest
	$(PYTEST) $(WORKERS) -m "long or not long" tests/studio/test_browser*.py

pytest-long: $(VENV)/package $(VENV)/dev studio system ## the Python tests marked long, but for the kills: what shorter tests show too
	$(PYTEST) $(WORKERS) -m long --deselect tests/test_kills.py

kills: $(VENV)/package $(VENV)/dev ## kill -9 a hundred times during estimate, soils, a fit saved and an upload
	TERRAGRIP_KILLS=$(KILLS) $(BIN)/python -m pytest tests/test_kills.py -m long -q -n $(WORKERS) -rP

SOAK_SECONDS ?= 3600
soak: system $(VENV)/package $(VENV)/dev ## the live service at 1 kHz with random faults for SOAK_SECONDS, an hour; then its promises are checked
	@$(BIN)/python benchmarks/soak.py --seconds $(SOAK_SECONDS)

soak-short:
	@$(MAKE) --no-print-directory soak SOAK_SECONDS=60

# Not stack: a sanitizer needs far more of it, and watches what is read there.
WATCHED = $(filter-out stack,$(KERNEL_TESTS))
kernel-sanitized: $(foreach real,sanitized sanitized-float,$(WATCHED:%=build/kernel/$(real)/%))
	@for program in $^; do echo "$$program"; ./$$program 10000 > /dev/null || exit 1; done

fuzz: fuzz-kernel fuzz-parsers ## fuzz the kernel (libFuzzer) and every parser (atheris); longer: make fuzz FUZZ_SECONDS=600

system-fuzz:
	@if ! command -v $(FUZZ_CC) >/dev/null 2>&1 && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then \
	  echo "Installing $(FUZZ_CC) for the kernel's fuzzers"; \
	  { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends clang libclang-rt-dev; } >/dev/null 2>&1 || true; fi

FUZZ_FLAGS := -std=c99 -O1 $(SANITIZERS) -fsanitize=fuzzer-no-link -Wall -Wextra -Wno-psabi -Werror \
	-Ikernel/include -Ikernel/src -Ikernel/tests
build/fuzz/objects/%.o: kernel/src/%.c $(KERNEL_HEADERS) Makefile
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_FLAGS) -c -o $@ $<

build/fuzz/kernel-%: fuzz/kernel/%.c fuzz/kernel/bytes.h $(patsubst kernel/src/%.c,build/fuzz/objects/%.o,$(KERNEL_SOURCES))
	$(FUZZ_CC) $(FUZZ_FLAGS) -fsanitize=fuzzer -o $@ $(filter %.c %.o,$^) -lm

fuzz-kernel: system-fuzz
	@if echo 'int LLVMFuzzerTestOneInput(const char *d, unsigned long n) { return d && n > 9 ? 0 : 0; }' \
	    | $(FUZZ_CC) -fsanitize=fuzzer -x c - -o /dev/null 2>/dev/null; then $(MAKE) --no-print-directory fuzz-kernel-run; \
	else echo "SKIPPED: the kernel's fuzzers need clang with libFuzzer; on Debian and Ubuntu: apt-get install clang libclang-rt-dev" >&2; fi

fuzz-kernel-run: $(FUZZERS)
	@for program in $^; do name=$${program##*kernel-}; mkdir -p build/fuzz/corpus-$$name build/fuzz/found; echo "$$program"; \
	  $$program -max_total_time=$(FUZZ_SECONDS) -max_len=4096 -timeout=20 -rss_limit_mb=1000 -print_final_stats=1 \
	    -artifact_prefix=build/fuzz/found/$$name- build/fuzz/corpus-$$name fuzz/corpus/kernel-$$name > build/fuzz/$$name.log 2>&1 \
	    || { tail -40 build/fuzz/$$name.log; exit 1; }; grep number_of_executed_units build/fuzz/$$name.log; done

fuzz-parsers: $(VENV)/package $(VENV)/dev
	@$(BIN)/python fuzz/parsers.py --each $(FUZZ_SECONDS)

# The same tests built for a 64-bit ARM machine (a Raspberry Pi, a Jetson) and run by qemu. Not part of `make test`: see docs/install.md.
AARCH64_CC ?= aarch64-linux-gnu-gcc
AARCH64_RUN ?= qemu-aarch64 -L /usr/aarch64-linux-gnu
$(eval $(call kernel_rules,aarch64-double,))
$(eval $(call kernel_rules,aarch64-float,-DTG_FLOAT))

kernel-aarch64: ## cross-compile the kernel for 64-bit ARM and run its C tests under qemu
	@for name in $(AARCH64_CC) $(firstword $(AARCH64_RUN)); do command -v $$name >/dev/null 2>&1 || { \
	  echo "make: $$name is missing; on Debian and Ubuntu: apt-get install gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user" >&2; exit 1; }; done
	@$(MAKE) --no-print-directory CC=$(AARCH64_CC) $(foreach real,double float,$(KERNEL_TESTS:%=build/kernel/aarch64-$(real)/%))
	@for program in $(foreach real,double float,$(KERNEL_TESTS:%=build/kernel/aarch64-$(real)/%)); do \
	  echo "$$program"; $(AARCH64_RUN) ./$$program || exit 1; done

# Does the C of the package compile for macOS and Windows? By clang inside the PyPI package ziglang, put into build; nothing is run.
OTHERS := aarch64-macos x86_64-macos x86_64-windows-gnu aarch64-windows-gnu
kernel-others: $(VENV)/made ## compile the package's C for macOS and Windows (downloads ziglang, 80 MB)
	@$(PIP) install --quiet --target build/ziglang --upgrade ziglang
	@for target in $(OTHERS); do for source in $(KERNEL_SOURCES) kernel/python/cpu.c src/terragrip/simulation/plant.c; do \
	  PYTHONPATH=build/ziglang $(BIN)/python -m ziglang cc -target $$target -std=c99 -O2 -fno-math-errno -fno-trapping-math -ffp-contract=off -Wall -Wextra -Werror \
	    -Ikernel/include -Ikernel/src -c -o build/others.o $$source || exit 1; done; echo "$$target: compiles"; done
