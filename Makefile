# `make help` lists the targets. Options are given after the target: make book BLENDER=0
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON  ?= $(shell command -v python3.11 || echo python3)
BLENDER ?= 1
ALL     ?=
TORCH   ?=

VENV := .venv
BIN  := $(VENV)/bin
CHAPTERS := $(wildcard chapters/[0-9]*.ipynb) $(wildcard book/*.ipynb)
EDITIONS := _build/editions/index.ipynb
CHECKED  := src tests book/_ext $(wildcard benchmarks) $(CHAPTERS)
# The environment belongs to one Python and one folder; the stamp is named after all that
# decides what is installed.
HOME_IS := $(shell "$(PYTHON)" -c 'import sys; print(sys.version_info[:3])' 2>/dev/null) $(CURDIR)
STAMP := $(VENV)/.installed-$(shell { cat requirements.lock pyproject.toml; echo '$(BLENDER) $(TORCH) $(HOME_IS)'; } | cksum | cut -d' ' -f1)

.PHONY: help book test pages pdf lab results bench mutants lint format lock clean install

help: ## list the targets
	@echo "make TARGET [PYTHON=python3.11] [BLENDER=0] [ALL=1] [TORCH=wheel-or-requirement]"
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | while IFS=$$'\t' read -r t d; do printf '  %-8s %s\n' "$$t" "$$d"; done

book: install ## install what is needed, execute the chapters, render the pages
	@$(BIN)/python -m fpputil.probe
	$(BIN)/jupyter-book build . -W -n --keep-going
	@$(BIN)/python -c 'import pathlib; print("\nOpen", pathlib.Path("_build/html/index.html").resolve().as_uri())'

# Outputs are compared on the reference Python; others have another NumPy, OpenCV and Blender.
NBVAL = --nbval$$($(BIN)/python -c 'import sys; print("-lax" * (sys.version_info[:2] != (3, 11)))')
PROVED := tests src --doctest-modules --ignore=src/fpputil/cli/__main__.py \
  $(CHAPTERS) --nbval-current-env --nbval-sanitize-with tests/nbval.cfg
FAST := $(if $(filter 1,$(ALL)),,-m "not slow")
# Two processes that never wait for each other; a fifth faster than with two threads each.
test: install ## prove it: style, unit tests, every chapter, every page; ALL=1: the slow tests, too
	@$(BIN)/python -m fpputil.probe
	@$(MAKE) --no-print-directory lint
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest $(PROVED) $(NBVAL) $(FAST) -n 2 --dist loadfile
	@echo; echo "All proved."

pages: install ## render the pages from the stored outputs, executing nothing
	FPP_EXECUTE=off $(BIN)/jupyter-book build . -W -n --keep-going --path-output _build/stored

PDF ?= _build/book.pdf
pdf: install ## print the book, from the stored outputs, as one PDF (needs Chromium or Chrome)
	FPP_EXECUTE=off $(BIN)/jupyter-book build . --builder singlehtml --path-output _build/stored
	cd _build/stored/_build/singlehtml && cp book/index.html all.html # its addresses are those of the top
	$(BIN)/python book/_ext/make_pdf.py _build/stored/_build/singlehtml/all.html $(PDF)

lab: install $(EDITIONS) ## open JupyterLab on your copies of the chapters, in my-chapters/
	@$(BIN)/python book/_ext/fpp_copies.py
	$(BIN)/jupyter lab --notebook-dir my-chapters my-chapters/index.ipynb

# Every build writes them; from the stored outputs it takes a minute.
$(EDITIONS): $(STAMP) $(CHAPTERS) $(wildcard book/*.md book/_ext/*.py src/fpputil/*/*.py) _config.yml _toc.yml
	@echo "Making the notebooks to read: a minute, when the chapters changed"
	FPP_EXECUTE=off $(BIN)/jupyter-book build . -q --path-output _build/stored

results: install ## make the runs behind the tables that are missing (hours; resumable)
	mkdir -p sets
	$(BIN)/fpp dataset generate --preset tiny --models 1000 --held-out 60 --views 18 --seed 1 --workers 2 sets/tiny
	$(BIN)/fpp results rates
	$(BIN)/fpp results run all
	$(BIN)/fpp results list

bench: install .venv-peer ## compare speeds, side by side with a peer package
	$(BIN)/python -m benchmarks --peer .venv-peer/bin/python

.venv-peer: # `fringes` needs another OpenCV than ours
	"$(PYTHON)" -m venv $@.part
	$@.part/bin/python -m pip install -q fringes==2.1.0
	mv $@.part $@

MUTANTS ?= --number 100 --seed 0
mutants: install .venv-mutants ## make single faults and count those that the fast tests notice (an hour; resumable)
	.venv-mutants/bin/python benchmarks/mutants.py $(MUTANTS)

.venv-mutants: # `cosmic-ray` makes the faults; it needs a web framework and a database besides
	"$(PYTHON)" -m venv $@.part
	$@.part/bin/python -m pip install -q cosmic-ray==8.7.0
	mv $@.part $@

lint: install ## check style and format
	$(BIN)/ruff check $(CHECKED)
	$(BIN)/ruff format --check $(CHECKED)

format: install ## mend style and format
	$(BIN)/ruff check --fix $(CHECKED)
	$(BIN)/ruff format $(CHECKED)

# torch's own metadata pulls nvidia-*, cuda-* and triton where its wheel needs them.
lock: install ## resolve requirements.lock anew, keeping versions that still fit
	cp requirements.lock $(VENV)/new.lock
	$(BIN)/uv pip compile -q pyproject.toml --extra learning --extra blender --extra cluster --extra dev --universal --python-version 3.11 \
	  -c <(echo torch==2.13.0) --no-annotate --custom-compile-command "make lock" -o $(VENV)/new.lock
	grep -Ev '^(nvidia|cuda|triton)[-=]' $(VENV)/new.lock > requirements.lock

clean: ## remove everything built, but not .venv
	rm -rf _build .pytest_cache .ruff_cache .hypothesis
	find src tests book -name __pycache__ -prune -exec rm -rf {} +

install: $(STAMP)

$(STAMP):
	@"$(PYTHON)" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null || \
	  { echo "$(PYTHON) is missing or not 3.11 to 3.13; name another: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip' 2>/dev/null || \
	  { echo "$(PYTHON) cannot make environments; on Debian: apt install python3-venv" >&2; exit 1; }
	@grep -qsxF '$(HOME_IS)' $(VENV)/.home || { "$(PYTHON)" -m venv --clear $(VENV) && echo '$(HOME_IS)' > $(VENV)/.home; }
	@rm -f $(VENV)/.installed-*
	@echo "To be downloaded, unless pip has it already (sizes are approximate):"
	@echo "  0.5 GB  the packages of requirements.lock (2.1 GB installed)"
	@$(if $(filter 0,$(BLENDER)),echo "  0 GB    Blender's bpy is left out (BLENDER=0)",\
	  echo "  0.4 GB  Blender's bpy (0.8 GB installed); BLENDER=0 leaves it out")
	@$(if $(TORCH),echo "  torch comes from $(TORCH)",\
	  echo "  0.2 GB  torch, where pip finds a CPU wheel; on Linux the public registry's"; \
	  echo "          wheel is the CUDA build: 3 GB (7 GB installed); see README, TORCH=...")
	$(if $(TORCH),$(BIN)/pip install $(TORCH))
	@grep -Ev '$(if $(filter 0,$(BLENDER)),^bpy==|,)$(if $(TORCH),^torch==|,)^$$' requirements.lock > $(VENV)/install.lock
	$(if $(filter 0,$(BLENDER)),$(BIN)/pip uninstall -q -y bpy)
	$(BIN)/pip install --no-compile -r $(VENV)/install.lock
	@echo "Compiling on all cores, where pip takes one"
	@$(BIN)/python -m compileall -q -j 0 $(VENV)/lib > $(VENV)/compiled.log || true # some files are for other Pythons
	$(BIN)/pip install --no-deps --no-build-isolation -e .
	@touch $@
