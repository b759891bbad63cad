# `make run` and `make test` set up all they need in .venv, on first use and whenever it is stale.
#   make run ARGS='--ros-args -p rate:=500.0'    PYTHON=python3.12 picks the Python of a new .venv
VENV := .venv
PY := $(VENV)/bin/python
KERNEL := planar_chain_sim/kernel

# Scripts in a virtual environment hold absolute paths, so one that was moved or copied is stale: stamps bear the folder.
FOLDER := $(shell pwd | cksum | cut -d ' ' -f 1)
RUN_READY := $(VENV)/run-ready-$(FOLDER)
CHECK_READY := $(VENV)/check-ready-$(FOLDER)
TEST_READY := $(VENV)/test-ready-$(FOLDER)
BENCH_READY := $(VENV)/bench-ready-$(FOLDER)
DOCS_READY := $(VENV)/docs-ready-$(FOLDER)
RUN_EXTRAS := ros,pictures,view
CHECK_EXTRAS := test
TEST_EXTRAS := ros,test
BENCH_EXTRAS := ros,benchmark
DOCS_EXTRAS := ros,pictures,docs
SOURCES := setup.py pyproject.toml $(wildcard $(addprefix $(KERNEL)/,*.cpp */*.hpp */*/*.hpp))

# The packages of a sourced ROS belong to its own Python; here everything comes from .venv.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH

# pip compiles nothing, which halves the set-up; what is imported is compiled then, and the node must start fast again.
unexport PYTHONDONTWRITEBYTECODE

# Stay on this machine unless told otherwise.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

.PHONY: run help check test lint colcon docs bench soak fuzz races aarch64 clean
.NOTPARALLEL:

# The page shows what the simulator publishes and ends with it.
run: $(RUN_READY)
	@$(if $(filter 0,$(VIEW)),,$(VENV)/bin/view --beside $(ARGS) &) exec $(VENV)/bin/simulator $(ARGS)

help:
	@echo 'make run      simulate until Ctrl-C, with a page in the browser unless VIEW=0'
	@echo '              ARGS="double_pendulum.yaml --ros-args -p rate:=500.0" are arguments'
	@echo 'make check    run the fast tests, none of which needs ROS: a minute or two'
	@echo 'make test     run all tests; ARGS="test/ros/test_node.py -k pause" are arguments of pytest'
	@echo 'make lint     style, types and compiler warnings'
	@echo 'make colcon   build as a ROS 2 workspace does, below build/'
	@echo 'make docs     write the page of the Python API into build/docs'
	@echo 'make bench    measure accuracy and speed beside other libraries, half an hour, into build/benchmark'
	@echo 'make soak     long tests: scenes, signals, floods, ten minutes under load'
	@echo 'make fuzz, make races, make aarch64    the kernel under memory and thread sanitizers, on ARM'
	@echo 'make clean    remove .venv and all that was built'
	@echo 'The first run, test or bench makes .venv: a download of 160 MB (400 MB for tests) and a compilation.'
	@echo 'PYTHON=python3.12 and CXX=clang++ choose the tools of a new .venv.'

check: $(CHECK_READY)
	$(PY) -m pytest --ignore test/ros -m 'not slow and not ros' $(ARGS)

test: $(TEST_READY)
	$(PY) -m pytest $(ARGS)

lint: $(TEST_READY)
	$(VENV)/bin/ruff check
	$(PY) -m pycodestyle .
	$(VENV)/bin/mypy
	$(VENV)/bin/clang-format --dry-run --Werror $$(find $(KERNEL) -name '*.[ch]pp')
	$(CXX) -std=c++17 -fvisibility=hidden -fsyntax-only -Wall -Wextra -Wpedantic -Werror $(KERNEL)/bindings.cpp \
	  $$($(PY) -c 'import pybind11, sysconfig; print("-isystem", sysconfig.get_path("include"), "-isystem", pybind11.get_include())')

# Both layouts of the ROS 2 build, below build/: copied files, and links to the sources.
COLCON = PATH="$(CURDIR)/$(VENV)/bin:$$PATH" colcon --log-base build/log
colcon: $(TEST_READY)
	$(COLCON) build --build-base build/copied --install-base build/install-copied
	$(COLCON) build --build-base build/linked --install-base build/install-linked --symlink-install

# The page of the Python API; a warning of the generator ends it.
docs: $(DOCS_READY)
	$(PY) docs/api.py build/docs

# All suites within half an hour on two cores; ARGS='work-precision --picture work.svg' for one of them.
BENCH_FOLDER := build/benchmark
bench: $(BENCH_READY)
	@exec $(VENV)/bin/benchmark $(or $(ARGS),all --folder $(BENCH_FOLDER))

# Tests that take too long for every day: scenes that try to break the integrator, stop signals twenty times each, a flood of
# 1e5 commands, ten minutes under full load.
soak: $(BENCH_READY) $(TEST_READY)
	@mkdir -p $(BENCH_FOLDER)
	@rm -f $(BENCH_FOLDER)/stability*
	$(VENV)/bin/benchmark stability --csv $(BENCH_FOLDER)/stability.csv --picture $(BENCH_FOLDER)/stability.png \
	  --peers MuJoCo
	SOAK=20 $(PY) -m pytest test/ros/test_node_process.py test/ros/test_neighbours.py -k 'stop_signal or flood'
	SOAK=30 $(PY) -m pytest test/ros/test_joining.py
	$(PY) -m planar_chain_sim.benchmark.soak --rate 1000 --seconds 600
	$(PY) -m planar_chain_sim.benchmark.soak --rate 2000 5000 --seconds 60
	$(MAKE) fuzz races

# The kernel's border with a kernel that watches its memory, then its arithmetic (`fuzz`), or its threads (`races`), for
# some minutes each; SECONDS=3600 for an hour. Linux and gcc: a sanitizer's library must come before Python's.
FUZZ_SECONDS := $(or $(SECONDS),300)
WATCH_memory := -fsanitize=address
WATCH_arithmetic := -fsanitize=undefined,float-cast-overflow -fno-sanitize-recover=all
WATCH_threads := -fsanitize=thread
build/watch-%.so: $(SOURCES) $(TEST_READY) Makefile
	@mkdir -p build
	$(CXX) -std=c++17 -O1 -g1 -ffp-contract=off -fvisibility=hidden -fPIC -shared -pthread -DPLANAR_CHAIN_NARROW \
	  -D_GLIBCXX_ASSERTIONS $(WATCH_$*) $(KERNEL)/bindings.cpp -o $@ \
	  $$($(PY) -c 'import pybind11, sysconfig; print("-I", sysconfig.get_path("include"), "-I", pybind11.get_include())')

# The package beside the one in use, with that kernel.
WATCHED = @rm -rf build/$(1) && mkdir build/$(1) && cp -r planar_chain_sim config build/$(1) && \
  rm -f build/$(1)/planar_chain_sim/_kernel*.so && cp build/watch-$(1).so build/$(1)/planar_chain_sim/_kernel.so
LIBRARIES = LD_PRELOAD="$$(for part in $(1); do $(CXX) -print-file-name=lib$$part.so; done | xargs)"
FUZZ = PYTHONPATH=build/$(1) $(PY) test/oracles/border_fuzz.py --seconds $(FUZZ_SECONDS) $(2) $(ARGS)
fuzz: build/watch-memory.so build/watch-arithmetic.so
	$(call WATCHED,memory)
	$(call LIBRARIES,asan stdc++) ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1 $(call FUZZ,memory)
	$(call WATCHED,arithmetic)
	UBSAN_OPTIONS=print_stacktrace=1 $(call FUZZ,arithmetic)
races: build/watch-threads.so
	$(call WATCHED,threads)
	@echo race:dl_deallocate_tls >build/threads/known   # the C library's own lock is not seen
	$(call LIBRARIES,tsan) TSAN_OPTIONS='halt_on_error=1 report_signal_unsafe=0 suppressions=build/threads/known' \
	  $(call FUZZ,threads,--races)

# The kernel for another kind of processor, emulated, against the one here: needs a cross compiler and qemu-user.
aarch64: $(RUN_READY)
	@mkdir -p build
	aarch64-linux-gnu-g++ -std=c++17 -O2 -ffp-contract=off -static test/kernel/trajectory.cpp -o build/trajectory-aarch64
	$(PY) test/kernel/portable_bits.py qemu-aarch64-static build/trajectory-aarch64

# A candidate is run, not looked up: a name on the PATH can be a shim that fails, or lack venv or the C headers.
CANDIDATES := $(or $(PYTHON),python3.14 python3.13 python3.12 python3.11 python3.10 python3)
WORKS := import ensurepip, os, sys, sysconfig, venv; \
  sys.exit(sys.version_info < (3, 10) or not os.path.exists(sysconfig.get_path("include") + "/Python.h"))
# Built with the tools that colcon will find, not in isolation: an edited kernel then compiles with no network at hand.
BUILD_TOOLS := 'setuptools>=70.1,<80' wheel 'pybind11>=2.11'
PIP := $(PY) -m pip install --quiet --disable-pip-version-check --no-compile
define set_up
	@command -v $(CXX) >/dev/null || { echo 'no C++ compiler $(CXX): install one or name it with CXX=...' >&2; exit 1; }
	@for python in $(if $(wildcard $(VENV)/*-ready-$(FOLDER)),$(PY)) $(CANDIDATES) none; do \
	  $$python -c '$(WORKS)' 2>/dev/null && break; done; \
	case $$python in \
	  $(PY)) ;; \
	  none) echo 'no Python 3.10 or newer with venv and C headers: install python3-venv and python3-dev,' \
	    'or name one with PYTHON=/path/to/python3' >&2; exit 1 ;; \
	  *) $$python -m venv --clear $(VENV) ;; \
	esac
	@echo 'setting up $(VENV), once: 160 MB or more to download, and a minute or two of compiling ...' >&2
	$(PIP) $(BUILD_TOOLS)
	$(PIP) --no-build-isolation --editable '.[$(1)]'
endef

$(RUN_READY): $(SOURCES)
	$(call set_up,$(RUN_EXTRAS))
	@touch $(RUN_READY)

$(CHECK_READY): $(SOURCES)
	$(call set_up,$(CHECK_EXTRAS))
	@touch $(CHECK_READY)

$(TEST_READY): $(SOURCES)
	$(call set_up,$(TEST_EXTRAS))
	@touch $(RUN_READY) $(CHECK_READY) $(TEST_READY)

$(DOCS_READY): $(SOURCES)
	$(call set_up,$(DOCS_EXTRAS))
	@touch $(RUN_READY) $(DOCS_READY)

$(BENCH_READY): $(SOURCES)
	$(call set_up,$(BENCH_EXTRAS))
	@touch $(RUN_READY) $(BENCH_READY)

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis planar_chain_sim/_kernel*.so
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
