"""Which test runs a command of a page that is not marked as not tested.

Commands without a graph are run by `test_small_runs.py`, on a few rows, scenes and epochs.
"""

SMALL = {
    "sain_sim collect", "sain_model train", "sain_model evaluate",
    "sain_model identify", "sain_eval evaluate", "sain_bags info",
    "sain_bags recover", "sain_bags to_dataset", "sain_bags report",
    "sain_eval.plots.library_picture",
}  # fmt: skip
TERMINAL = "tests/documentation/test_terminal.py"
CLOSED_LOOP = "tests/system/test_closed_loop.py"
EXAMPLES = "tests/examples/test_examples.py"
GYMNASIUM = "tests/examples/test_gymnasium_examples.py"
PARTS = "tests/examples/test_my_parts.py"
BY_TEST = {  # program -> test that starts it
    "make demo": CLOSED_LOOP,
    "make live": "tests/system/test_live.py",
    "make docs": "tests/documentation/test_site.py",
    "sain_bringup closed_loop": CLOSED_LOOP,
    "sain_bringup graph": TERMINAL,
    "sain_bringup live": "tests/system/test_live.py",
    "sain_live page_node": "tests/sain_live/ros/test_page_node.py",
    "sain_bringup watch": TERMINAL,
    "sain_bringup push": TERMINAL,
    "sain_bringup goal": TERMINAL,
    "sain_bringup reset": TERMINAL,
    "sain_bags record": TERMINAL,
    "sain_bags view": "tests/sain_bags/ros/test_view.py",
    "sain_bags play": "tests/system/test_play.py",
    "sain_sim sim_node": "tests/sain_core/ros/test_node_main.py",
    "sain_model model_node": "tests/system/test_play.py",
    "sain_mppi mppi_node": "tests/system/test_play.py",
    "examples/01_push_a_disk.py": EXAMPLES,
    "examples/02_plan_a_push.py": EXAMPLES,
    "examples/03_closed_loop_without_ros.py": EXAMPLES,
    "examples/04_compare_planners.py": EXAMPLES,
    "examples/06_train_in_gymnasium.py": GYMNASIUM,
    "examples/07_demonstrations_for_lerobot.py": GYMNASIUM,
}
PAGES_BY_TEST = {  # pages whose commands are those of one test
    "docs/tutorials/walk.md": "tests/system/test_walk.py",
    "examples/my_model/README.md": "tests/examples/test_my_model.py",
    "docs/guides/your_model.md": "tests/examples/test_my_model.py",
    "examples/my_world/README.md": "tests/examples/test_my_world.py",
    "docs/guides/your_world.md": "tests/examples/test_my_world.py",
    "docs/guides/real_pushes.md": "tests/sain_model/importing/test_guide.py",
    "docs/guides/your_robot.md": "tests/examples/test_my_robot.py",
    **{f"docs/guides/your_{part}.md": PARTS for part in ("shape", "cost", "planner", "scenario")},
}


def program(words: list[str]) -> str:
    """What a command starts: package and executable, target, script or module."""
    words = [word for word in words if word not in ("./env", "nice")]
    match words:
        case ["ros2", "run", package, name, *_]:
            return f"{package} {name}"
        case ["python", "-m", module, *_]:
            return module
        case ["python", path, *_]:
            return path
        case ["make", target, *_]:
            return f"make {target}"
    return words[0]


def runner(page: str, words: list[str]) -> str:
    """The test that runs a command of a page; "": none does."""
    if page in PAGES_BY_TEST:
        return PAGES_BY_TEST[page]
    if "--help" in words:
        return "tests/workspace/test_commands.py"
    name = program(words)
    return "tests/documentation/test_small_runs.py" if name in SMALL else BY_TEST.get(name, "")
