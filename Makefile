# Everything runs inside the workspace's environment, which ./env sets up on first use.

.DEFAULT_GOAL := help
LINTERS := lint-types lint-style lint-imports lint-prose lint-shell lint-docker
.PHONY: help demo live docs test test-all lint $(LINTERS) format bench table faults real anything pusht dist lock outdated clean

SHELL_SCRIPTS := env .ci/run tools/setup.sh tools/browser.sh docker/entrypoint.sh
GROUPS := ros graph test lint docs

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{ printf "  make %-8s %s\n", $$1, $$2 }'
	@echo "  ./env CMD     any command inside the environment, for example ./env ros2 pkg executables"

# One evaluation: the folder below results/table, and its options. The tolerances of poses are those of docs/explanation/shapes.md.
define evaluate
	@./env ros2 run sain_eval evaluate --out results/table/$(1) $(2) $(ARGS)
endef
PLACES := --tolerances 0.05,0.02,0.01,0.005 --scenario
POSES := --tolerances 0.02:0.1,0.01:0.05,0.005:0.03 --scenario
MUJOCO := --engine mujoco
COMMA := ,
BOTH := --controllers planar,sain
SAIN := --controllers sain

demo: ## the closed loop on the whole graph, headless: a few episodes, a bag and a report page
	@./env ros2 run sain_bringup closed_loop $(ARGS)

live: ## the graph and its live page in the browser, until Ctrl-C; ARGS="--scenario rearrange_3 --port 8081"
	@./env ros2 run sain_live live $(ARGS)

docs: ## this documentation as a site, results/site/index.html, built without the network; ARGS=serve rebuilds it after each edit
	@NO_MKDOCS_2_WARNING=1 ./env python -m mkdocs $(or $(ARGS),build --strict --quiet) --config-file tools/site/mkdocs.yml
	@$(if $(ARGS),,echo "Open $(CURDIR)/results/site/index.html in a browser.")

test: ## the tests but for whole graphs, long trainings, installs and browsers; a part of them with ARGS="tests/sain_core -k wrap"
	@./env python -m pytest $(ARGS)

test-all: ## every test
	@tools/browser.sh
	@./env python -m pytest --all $(ARGS)

lint: ## style, types, import boundaries, prose, shell scripts, Docker files
	@./env --with lint --with test true
	@$(MAKE) --no-print-directory --jobs=2 --keep-going --output-sync=target $(LINTERS)

lint-types: ; @./env mypy
lint-style: ; @./env ruff check && ./env ruff format --check
lint-imports: ; @./env lint-imports --no-logo && ./env python tools/circles.py
lint-prose: ; @./env python tools/prose.py
lint-shell: ; @./env shellcheck --external-sources $(SHELL_SCRIPTS)
lint-docker:
	@./env hadolint docker/Dockerfile
	@./env check-jsonschema --builtin-schema vendor.compose-spec docker/compose.yaml

format: ## rewrites the Python code in the project's format
	@./env ruff check --fix
	@./env ruff format

bench: ## timings beside those of others; some of them, or other rooms, with ARGS="planar_prior"
	@./env python -m benchmarks $(or $(ARGS),speed)

table: ## results/results.md and its picture: scenarios in Bullet, its rough world, MuJoCo, its measured world and gym-pusht; fewer with ARGS="--scenes 5"
	$(call evaluate,bullet/paper,$(PLACES) paper$(COMMA)paper_shift --scenes 40 --seed 500000 $(BOTH))
	$(call evaluate,bullet/paper_cube,$(PLACES) paper_cube --scenes 100 --seed 501000 $(BOTH))
	$(call evaluate,bullet/anywhere,$(PLACES) anywhere --scenes 300 --seed 400000 $(BOTH))
	$(call evaluate,bullet/push_t,$(POSES) push_t --scenes 100 --seed 502000 $(BOTH))
	$(call evaluate,bullet/rearrange_3,$(POSES) rearrange_3 --scenes 50 --seed 503000 $(SAIN))
	$(call evaluate,bullet/shapes,$(POSES) shapes --scenes 110 --seed 507000 $(SAIN))
	$(call evaluate,bullet/shapes_indirect,$(POSES) shapes_indirect --scenes 40 --seed 508000 $(SAIN))
	$(call evaluate,bullet/blocked,$(POSES) blocked --scenes 40 --seed 509000 $(SAIN))
	$(call evaluate,rough/anywhere,--world rough $(PLACES) anywhere --scenes 100 --seed 505000 $(BOTH))
	$(call evaluate,mujoco/anywhere,$(MUJOCO) $(PLACES) anywhere --scenes 300 --seed 420000 $(BOTH))
	$(call evaluate,mujoco/push_t,$(MUJOCO) $(POSES) push_t --scenes 100 --seed 504000 $(BOTH))
	$(call evaluate,measured/anywhere,$(MUJOCO) --world measured --lab 7 $(PLACES) anywhere --scenes 100 --seed 506000 $(BOTH))
	@./env --with test pip install --quiet --no-deps --no-build-isolation ./examples/pusht
	@./env ros2 run sain_eval evaluate --engine gym-pusht --scenario gym-pusht --controllers pusht --tolerances 0.01 \
		--planner.speeds 0.32 --planner.correction-speed 0.32 --planner.samples 256 --planner.horizon 2 \
		--out results/table/pusht --scenes 100 $(ARGS)
	@./env ros2 run sain_eval results results/table/bullet/* results/table/rough/* results/table/mujoco/* \
		results/table/measured/* results/table/pusht
	@./env python -m benchmarks.results.results_figure

faults: ## results/faults.md: what the graph makes of killed and stopped nodes, an arm that fails, and hostile input; takes an hour
	@./env python -m benchmarks.faults.graph_faults --page results/faults.md $(ARGS)

real: ## results/real/: a page of errors on the real pushes at DATA=PATH; takes an hour, and continues after a stop
	@./env python -m benchmarks.real $(if $(DATA),--data "$(DATA)") $(ARGS)

anything: ## results/anything/: a page of times to goal and a film of the bodies in DATA=PATH, by the whole graph in real time; takes hours, and continues after a stop
	@./env python -m benchmarks.anything $(if $(DATA),--data "$(DATA)") $(ARGS)

pusht: ## results/pusht/: a page of stable-worldmodel's Push-T with each of its factors of variation; takes an hour, and continues after a stop
	@./env --with test python -m benchmarks.pusht $(ARGS)

dist: ## results/dist: sdist and wheel of this version, checked by twine and by an install
	rm -rf results/dist
	@./env uv build --quiet --out-dir results/dist
	@./env uv tool run --quiet twine==6.2.0 check --strict results/dist/*.tar.gz results/dist/*.whl
	@./env uv venv --quiet results/dist/venv
	@./env uv pip install --quiet --python results/dist/venv results/dist/*.whl
	@results/dist/venv/bin/sain --version

lock: ## requirements.txt from pyproject.toml, for Python 3.11 to 3.13
	@./env uv pip compile --quiet --universal --python-version 3.11 $(addprefix --group ,$(GROUPS)) pyproject.toml -o requirements.txt

outdated: ## the installed versions for which there are newer ones
	@./env --with test --with lint --with docs uv pip list --outdated

clean: ## removes the environment and all that was built; bags stay
	@[ ! -e .venv ] || [ -d .venv/stamps ] || { echo "make: .venv is not SAIN's; move it away." >&2; exit 1; }
	rm -rf .venv ros2_ws/build ros2_ws/install ros2_ws/log ros2_ws/.setup.lock
	rm -rf src/sain_model/sain_model/__pycache__/kernels
	rm -rf .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
