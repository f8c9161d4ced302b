"""The pages of the Python API: which modules they show; their text is made from the docstrings."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Final

SOURCE: Final = Path(__file__).resolve().parents[2] / "src"

PACKAGES: Final = {
    "sain_core": (
        "Scenes, pushes, the contract of models, and what all packages share.",
        ("scene", "push", "model", "world", "transitions", "guarding.plugins",
         "conformance", "feasibility", "shapes.bodies", "errors", "randomness"),
    ),
    "sain_sim": (
        "The simulated worlds.",
        ("world.world", "world.parameters", "world.engines", "collecting.collect"),
    ),
    "sain_arm": (
        "Robot arms under ros2_control.",
        ("robot.robot", "planning.push_planner", "planning.reach"),
    ),
    "sain_model": (
        "Priors, networks, and how they are trained and evaluated.",
        ("physics.planar", "dynamics.sain", "dynamics.load",
         "data.dataset", "training.settings"),
    ),
    "sain_mppi": (
        "The agent that decides, and the planner that it asks.",
        ("agent.agent", "agent.events", "planner", "algorithms.search"),
    ),
    "sain_bags": (
        "Recordings without ROS.",
        ("reading.reader", "rows.episodes", "dataset.conversion", "dataset.rows"),
    ),
    "sain_eval": (
        "Scenarios and closed loops without ROS.",
        ("scenes.scenarios", "loop.closed_loop", "loop.evaluation"),
    ),
    "sain_lab": (
        "Laboratories: what is learned where a table stands.",
        ("learner", "storage.results", "storage.laboratory", "judging.curves"),
    ),
    "sain_gym": (
        "The Gymnasium environment, and the agent as a policy in it.",
        ("push_env", "agent_policy"),
    ),
}  # fmt: skip
INTRODUCTION: Final = """# Python API

For developers who call the packages from Python. [The examples](../../tutorials/first_steps.md) use
most of it. Arrays have the sizes K samples, H horizon, N bodies, B batch.

| package | holds |
| --- | --- |
"""
ROOMS: Final = """
## Rooms

Each folder of modules has one purpose.
[Architecture](../../explanation/architecture.md#packages) shows what may import what.

| folder | holds |
| --- | --- |
"""


def pages() -> dict[str, str]:
    """Return a page for each package and one that lists them, by place in the site."""
    found, rows = {}, []
    for package, (about, modules) in PACKAGES.items():
        if not (SOURCE / package).exists():
            continue
        rows.append(f"| [`{package}`]({package}.md) | {about} |\n")
        shown = "\n\n".join(f"::: {package}.{module}" for module in modules)
        found[f"reference/api/{package}.md"] = f"# {package}\n\n{about}\n\n{shown}\n"
    found["reference/api/index.md"] = "".join([INTRODUCTION, *rows, ROOMS, *rooms()])
    return found


def rooms() -> Iterator[str]:
    """Yield a row for each folder of modules, with the docstring of its ``__init__.py``."""
    for package in PACKAGES:
        for path in sorted((SOURCE / package / package).glob("*/__init__.py")):
            if about := ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))):
                yield f"| `{package}.{path.parent.name}` | {' '.join(about.split())} |\n"
