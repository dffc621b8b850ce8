# Every target makes the environment that it needs first; see tools/environment.py.

# 5.2 (the current LTS), 5.3 (the newest, on Vulkan), 5.0 or 4.5 (the older LTS), each in an environment of its own.
BLENDER ?= 5.2
PYTHON3 ?= python3
STRESS ?= 2000
# Two processes: while one compiles shaders or runs Python, the other draws. More would only share a software GPU.
PARALLEL := -n 2 --dist worksteal

# Of fast tests compiling takes two thirds of the time and drawing a thirtieth. So a software GPU (Mesa's llvmpipe) leaves
# out optimizations there, which change no bit of a picture; COMPILE=full: none, as elsewhere.
COMPILE ?= quick
QUICKLY := $(if $(filter quick,$(COMPILE)),GALLIVM_PERF=nopt)

ENVIRONMENT := $(if $(filter 5.2,$(BLENDER)),.venv,.venv-$(BLENDER))
PYTHON := $(ENVIRONMENT)/bin/python

.DEFAULT_GOAL := help
.PHONY: help environment demo pictures samples test test-all test-more test-fast test-vulkan stress check matrix mutations package site test-window screenshots window-walk nodes pages bench bench-references bench-quick bench-viewport bench-beside clean

help: ## this list
	@echo "make TARGET [BLENDER=5.2|5.3|5.0|4.5] [COMPILE=full: fast tests with all optimizations of a software GPU]"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1@\2/p' Makefile | column -t -s @

environment: ## the virtual environment, with Blender as a Python module
	@$(PYTHON3) tools/environment.py --blender $(BLENDER)

demo: environment ## one sample, 4 and 16 beside Cycles in equal time, on a page
	$(PYTHON) -m addon compare sample_blends/soft_shadow_garden.blend --size 320x180 --samples 16 --reference-samples 48 --first-row --output out/demo

pictures: environment ## the README's picture, of the demo's scene in full size
	$(PYTHON) -m addon compare sample_blends/soft_shadow_garden.blend --reference-samples 128 --output out/picture
	$(PYTHON) tools/pictures.py out/picture docs/images/demo.png

samples: ## write the sample scenes anew, with Blender 4.5, so that every supported Blender opens them
	@$(PYTHON3) tools/environment.py --blender 4.5
	.venv-4.5/bin/python sample_blends/make.py

test: environment ## the tests that take seconds, and a sample of the slow ones (CANDELA_SAMPLE=seed): about 10 minutes
	@echo "About 10 minutes on two cores; 'make test-all' runs every test, in 25 to 50."
	$(QUICKLY) $(PYTHON) -m pytest $(PARALLEL) -m "not window and not timing" --slow=sample
	$(PYTHON) -m pytest -m timing --slow=sample

test-all: test ## every test that needs no window: those of `make test`, then the other slow ones
	$(PYTHON) -m pytest $(PARALLEL) -m "slow and not window and not timing" --slow=rest
	$(PYTHON) -m pytest -m "slow and timing" --slow=rest || [ $$? = 5 ]  # 5: none is left

test-more: environment ## a quarter of the slow tests beside those of `make test`: with it, what CI runs of them
	$(PYTHON) -m pytest $(PARALLEL) -m "slow and not window and not timing" --slow=more

test-fast: environment ## the tests that take seconds
	$(QUICKLY) $(PYTHON) -m pytest $(PARALLEL) -m "not window and not timing and not slow"
	$(PYTHON) -m pytest -m "timing and not slow"

test-vulkan: ## the tests that take seconds with Blender 5.3 on Vulkan, and a picture of both backends compared
	@$(PYTHON3) tools/environment.py --blender 5.3
	@$(PYTHON3) tools/environment.py --blender 5.2
	CANDELA_BACKEND=VULKAN .venv-5.3/bin/python -m pytest $(PARALLEL) -m "not window and not timing and not slow"
	mkdir -p build
	.venv/bin/python -m bench hashes write build/opengl.npz --only "cornell_box, 4"
	.venv-5.3/bin/python -m bench hashes compare build/opengl.npz --only "cornell_box, 4" --within 0.02

check: environment ## format, lint, every shader compiled, fast tests
	$(PYTHON) -m ruff format --check --quiet .
	$(PYTHON) -m ruff check --quiet .
	$(QUICKLY) $(PYTHON) -m pytest -q $(PARALLEL) -m "not window and not timing and not slow"

matrix: environment ## fast tests with each supported Blender (VERSIONS="5.0 4.5"), and the result on docs/versions.md
	$(PYTHON) tools/matrix.py $(VERSIONS)

mutations: environment ## small wrongs that the tests must notice
	$(PYTHON) -m bench mutations

package: environment ## the extension as a zip, in build/
	$(PYTHON) tools/package.py --output build

stress: environment ## random scenes against what must be true of every picture (STRESS=number of scenes)
	CANDELA_STRESS=$(STRESS) $(PYTHON) -m pytest tests/stress tests/techniques/test_stability.py

site: ## the manual as a website, in build/site
	test -x .venv-site/bin/mkdocs || { $(PYTHON3) -m venv .venv-site && .venv-site/bin/python -m pip install --quiet mkdocs==1.6.1; }
	.venv-site/bin/mkdocs build --quiet --config-file tools/site.yml
	@echo build/site/index.html

test-window: package ## the packaged extension in a real Blender with a window (REAL_BLENDER=command)
	$(PYTHON) -m pytest -m window tests/window

screenshots: package ## the manual's pictures, taken in a real Blender with a window
	$(PYTHON) -m pytest -m window tests/window -k "opengl and (nothing_failed or pass_tree or first_steps or tune or as_it_grows or every_feature)"
	$(PYTHON) tools/screenshots.py

window-walk: package ## ten minutes of random edits in a real Blender with a window
	STROLL_SECONDS=600 $(PYTHON) -m pytest -m window tests/window -rP -k random_walk

pages: environment ## every generated page anew, all of one commit: hours; the next call goes on where this one stopped
	$(PYTHON) -m bench pages

nodes: environment ## every shader node beside Cycles: docs/nodes.md
	$(PYTHON) -m bench.nodes

bench: environment ## run time against error of every technique, EEVEE and Cycles (BUDGET=minutes): docs/performance.md
	$(PYTHON) -m bench all $(if $(BUDGET),--budget $(BUDGET))

bench-references: environment ## what the benchmark compares with, rendered ahead; may run on a busy machine
	$(PYTHON) -m bench run --references --size $(or $(SIZE),256x192)

bench-quick: environment ## time against error, beside EEVEE and Cycles
	$(PYTHON) -m bench.quick

bench-beside: environment ## before a submission: time and error beside an older commit (OLD=a working tree of it)
	$(PYTHON) -m bench beside $(OLD) --keep

bench-viewport: environment ## what edits cost in the viewport: times and uploads
	$(PYTHON) -m bench.viewport

pairs: environment ## every pair of features in one room beside Cycles, as far as it is not known yet: docs/pairs.md
	$(PYTHON) -m bench pairs --alone
	$(PYTHON) -m bench pairs --page

clean: ## what was made here, except the environments
	rm -rf build out .pytest_cache .hypothesis .ruff_cache
	find addon tests bench sample_blends tools -name __pycache__ -prune -exec rm -rf {} +
