# The project's front door. `make demo` and `make test` set up what they need by themselves.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed

.PHONY: install demo demo-shot test lint fuzz test-machines bench bench-peers extension extension-repository blender-setup blender53-setup lock clean

install: $(STAMP)

# Rebuilt only when the lock or the project file changed. What is installed in place, pip does not compile to bytecode.
$(STAMP): requirements.lock pyproject.toml
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	$(BIN)/python -m compileall -q src
	touch $(STAMP)

demo: install
	$(BIN)/python examples/lounge/demo.py

# Two seconds of a travelling camera, as frames and as a video. It goes on where it was stopped.
demo-shot: install
	$(BIN)/lightdepth render examples/lounge/scene.toml --camera travel --frames 1-48 --samples 8 --steady 6 --denoise \
	  -o out/demo-shot/shot.####.exr
	$(BIN)/lightdepth deliver out/demo-shot/shot.####.exr --as video -o out/demo-shot/shot.mp4

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# In two processes, each of which computes with one thread; the tests of a file stay together.
test: lint
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile

# Ten thousand damaged files of every format; the suite tries a few hundred.
fuzz: install
	$(BIN)/python -m tests.fuzz

# The statistical tests with twelve seeds, under all instruction sets that this processor has, with one to four threads. A
# part of it: make test-machines MACHINES="--share 1/3", or "--targets avx2", or "--runs 2 -- tests/place".
test-machines: install
	$(BIN)/python -m tests.machine $(MACHINES)

# Truth and speed; the compared renderers take part where `make bench-peers` installed them.
bench: install
	$(BIN)/python -m bench
	$(BIN)/python -m pytest -m truth

bench-peers: .venv-peers/installed

.venv-peers/installed: bench/requirements-peers.lock
	$(PYTHON) -m venv --clear .venv-peers
	.venv-peers/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
	touch $@

# The Blender extension as a zip in dist/.
extension: install
	$(BIN)/python blender/build.py

# A folder to put on any web server, from which Blender installs the extension and updates it.
extension-repository: install
	$(BIN)/python blender/build.py --output dist/extension-repository --repository $(if $(WEBSITE),--website $(WEBSITE))

# Blender as Python modules, which the extension's tests run in. Those of 4.5 and 5.0 need Python 3.11, that of 5.3 needs
# Python 3.13 and is left out where there is none.
PYTHON313 ?= $(shell for each in python3.13 "$$HOME"/.pyenv/versions/3.13.*/bin/python; do \
	"$$each" -c "import sys; sys.exit(sys.version_info[:2] != (3, 13))" 2> /dev/null && command -v "$$each" && break; done)

blender-setup: .venv-bpy45/installed .venv-bpy50/installed blender53-setup

ifneq ($(PYTHON313),)
blender53-setup: .venv-bpy53/installed
.venv-bpy53/installed: PYTHON = $(PYTHON313)
else
blender53-setup:
	@echo "No Python 3.13 was found (name one in PYTHON313): the extension is not tested with Blender 5.3."
endif

.venv-bpy%/installed: blender/requirements-bpy%.lock
	$(PYTHON) -m venv --clear .venv-bpy$*
	.venv-bpy$*/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
	touch $@

# Needs `uv`; writes hashes and no registry's address.
lock:
	uv pip compile pyproject.toml --all-extras --group dev --group bench --universal --python-version 3.11 \
	  --generate-hashes --no-emit-index-url --no-header -q -o requirements.lock

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache build dist
