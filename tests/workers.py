"""Which tests run, and in which process: a file is a unit, some files are one unit together.

``pytest`` alone leaves out what is marked `system`: whole graphs, long trainings, installs and
browsers. ``pytest --all`` runs them, too, and a path on the command line all that is in it.

A whole run takes a worker for every core and one more, up to four: tests of graphs and of killed
processes wait a good part of their time. What is named on the command line runs in one process,
where a worker's start would cost more than it saves; ``-n 2`` says otherwise.

``pytest`` alone fails a test that takes more than three seconds of its process's time, which is two
where no other process shares the core: it is to be made smaller, or marked `system`. What imports
much, as the first test of a process may, is let pass.
"""

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any, Final

import pytest
from _pytest.config import Config
from xdist.scheduler import LoadScopeScheduling

MOST: Final = 4
DURATIONS: Final = "results/test_durations.txt"
TOGETHER: Final = {  # files that share a worker, by a part of their path
    "system": ("tests/system/",),
    "graph": ("/ros/",),
    "processes": ("sain_bringup/", "collecting/", "tests/workspace/", "guarding/test_lifetime"),
}
# The longest come first, so that no worker is left with one when all others are done.
SYSTEM: Final = (  # marked `system`, by a part of their names; others have the mark in their files
    "tests/system/", "tests/benchmarks/", "tests/examples/", "documentation/test_first_steps",
    "documentation/test_site",
    "workspace/setup/", "sain_bags/report/test_page", "sain_live/page/test_in_browser",
    "sain_live/test_whole_graph", "sain_live/test_view",
    "sain_live/ros/test_page_node", "training/test_fine_tuning", "training/test_any_bodies",
    "sain_gym/test_examples", "collecting/test_collect_on_ray", "collecting/test_workers",
    "compute/test_kernel_store", "formats/test_examples", "test_a_noisy_episode_reaches",
    "test_bodies_of_unknown_mass",
    "sain_arm/test_robot_mutations", "training/test_identified", "evaluation/test_named_models",
    # processes that are killed, stopped or hang
    "test_program.py::test_pip_install", "test_program.py::test_make_dist",
    "test_no_worker_outlives_a_process_that_is_killed", "test_a_recorder_that",
    "test_a_second_signal", "makes_the_bag_whole[15]",
    "test_push_and_watch_work_from_a_terminal", "test_ctrl_c_ends_a_collection_and_its_workers",
    "test_the_command_writes_the_same_files_with_one_process", "test_workers_change_no_byte",
    "behind_forty_others", "although_the_middleware_hangs", "although_the_interpreter_cannot",
    "hear_our_nodes[SUBNET]", "hear_our_nodes[LOCALHOST]", "sain_gym/test_vector",
    # strokes that are long, or two; a page of many commands; a fit
    "test_arm_node.py::test_pushes_are_made", "joints_states_are_frozen", "it_lifts_off_first",
    "whose_enable_signal_is_lost", "test_images_become_a_settled_scene",
    "test_the_arm_goes_home", "that_answers_twice", "from_before_an_abort",
    "test_a_controller_that_aborts[2-",
    "exist[docs/reference/results.md]", "test_what_is_learned_is_served_and_said",
    # trainings, and arms and files of which another one is in both
    "test_learner.py::test_a_table_that_changes",
    "evaluation/test_errors.py::test_the_command_lines", "test_a_belief_of_bodies_is_trained_on",
    "test_training_fits_them", "test_training_learns_a_residual", "test_ways_of_random_pushes",
    "lowers_the_error_of_rollouts", "test_each_push_is_learned_once", "reaches_the_guide_s_goal",
    "an_engine_that_explodes", "a_newer_goal_ends_the_action",
    "[xarm7]", "[panda]", "[so101]", "-xarm7]", "-panda]", "-ur5]", "sain_sim/bench/test_bench",
    "is_refused[noise]",
    "is_refused[origin]", "[lerobot]", "is_read_back_by", "of_lerobot_are",
    "test_workers_and_a_kill_change_no_byte", "test_the_next_push_is_predicted_better",
    "test_a_signal_ends_it_well",
    "too_large_for_the_robot_s_reach", "test_a_small_robot",
    "an_evaluation[rearrange_2-bullet-planar-0]",
)  # fmt: skip
ONE_GRAPH: Final = "system/test_closed_loop.py::test_an_episode_succeeds_and_says_so"  # always runs
MOST_S: Final = 3.0  # of the processor time that a test takes in its own process
MANY: Final = 100  # modules
FIRST: Final = ("tests/system/", "/ros/", "tests/examples/", "/training/")


class ByFile(LoadScopeScheduling):
    """Gives each worker one unit after another, in the order of the collection."""

    def __init__(self, config: Config, log: Any) -> None:
        super().__init__(config, log)
        # All kernels are compiled here, while the workers collect; each of them would compile them.
        command = [sys.executable, "-m", "sain_model.cli.kernels"]
        self.kernels = subprocess.Popen(command, stdout=subprocess.DEVNULL)

    def schedule(self) -> None:
        if self.kernels.wait() != 0:
            raise pytest.UsageError("the kernels cannot be compiled; the reason stands above")
        super().schedule()

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        for unit, parts in TOGETHER.items():
            if any(part in path for part in parts):
                return unit
        return path


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="run the tests marked system, too")


def pytest_xdist_auto_num_workers(config: Config) -> int:
    """Return how many workers ``-n auto`` starts; 0 is this process alone."""
    narrowed = any(config.getoption(name, None) for name in ("keyword", "markexpr", "lf"))
    if narrowed or names_paths(config):
        return 0
    return min(len(os.sched_getaffinity(0)) + 1, MOST)


def names_paths(config: Config) -> bool:
    """Return whether paths stand on the command line."""
    return config.args_source is not Config.ArgsSource.TESTPATHS


def pytest_xdist_make_scheduler(config: Config, log: Any) -> ByFile:
    return ByFile(config, log)


def runs_all(config: Config) -> bool:
    """Return whether tests that are marked `system` run, too."""
    return bool(config.getoption("--all") or config.getoption("markexpr") or names_paths(config))


def pytest_ignore_collect(collection_path: Path, config: Config) -> bool | None:
    """Do not import a file of which no test runs: some import what takes seconds."""
    if runs_all(config) or collection_path.suffix != ".py":
        return None
    name = collection_path.relative_to(config.rootpath).as_posix()
    left_out = any(part in name for part in SYSTEM) and ONE_GRAPH.partition("::")[0] not in name
    return left_out or None


def pytest_collection_modifyitems(config: Config, items: list[pytest.Item]) -> None:
    for item in items:
        if any(part in item.nodeid for part in SYSTEM):
            item.add_marker("system")
    if not runs_all(config):
        left_out = [item for item in items if _is_left_out(item)]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not _is_left_out(item)]
    items.sort(key=lambda item: _place(item.nodeid.partition("::")[0]))


def _is_left_out(item: pytest.Item) -> bool:
    return item.get_closest_marker("system") is not None and ONE_GRAPH not in item.nodeid


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """Fail a test that takes long, where those marked `system` are left out."""
    begun, modules = time.process_time(), len(sys.modules)
    result = yield
    taken = time.process_time() - begun
    imports = len(sys.modules) - modules > MANY
    if taken > MOST_S and not imports and not runs_all(item.config):
        pytest.fail(
            f"it took {taken:.1f} s of processor time, and {MOST_S} s are allowed: make it smaller,"
            " or mark it `system` (tests/workers.py)",
            pytrace=False,
        )
    return result


def _place(path: str) -> int:
    return next((place for place, part in enumerate(FIRST) if part in path), len(FIRST))


def pytest_terminal_summary(terminalreporter: Any, config: Config) -> None:
    """Write how long each test took, the longest first, where the whole suite ran."""
    if names_paths(config):
        return
    times: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                times[report.nodeid] += report.duration
    path = config.rootpath / DURATIONS
    path.parent.mkdir(exist_ok=True)
    path.write_text("".join(f"{time:8.2f} s  {test}\n" for test, time in times.most_common()))
