"""A name means one thing: classes are unique, and only the schema writes columns' names."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from sain_core.transitions import Column
from tests.workspace.source_tree import PYTHON_PACKAGES, SOURCE

SCHEMA = SOURCE / "sain_core/sain_core/transitions.py"
ROOMS = (
    "sain_sim/sain_sim/collecting",
    "sain_model/sain_model/data",
    "sain_bags/sain_bags/dataset",
)
# Words that other things have, too: messages, cards, files of others, parameters of the world.
COMMON = {
    "body", "duration", "episode", "friction", "goal", "log_time", "masses", "moved", "object",
    "outcome",
    "physics_next", "push_id", "radii", "roles", "run", "seed", "shapes", "source", "state", "step",
    "rim_friction", "surface", "tolerance",
    "tool_friction",
}  # fmt: skip
KEYS_OF_JSON = {"moved", "episode", "seed", "shapes"}  # of cards, journals and settings


def modules() -> Iterator[tuple[Path, ast.Module]]:
    for package in PYTHON_PACKAGES:
        for path in sorted((SOURCE / package / package).rglob("*.py")):
            yield path, ast.parse(path.read_text(), filename=str(path))


def literals(tree: ast.Module) -> set[str]:
    """All texts in a module but for those inside of others."""
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def test_no_two_public_classes_share_a_name() -> None:
    found = defaultdict(set)
    for path, tree in modules():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].add(str(path.relative_to(SOURCE)))
    assert len(found) > 200
    assert {name: paths for name, paths in found.items() if len(paths) > 1} == {}


def test_only_the_schema_writes_the_names_of_columns() -> None:
    names = set(Column) - COMMON
    assert {"action", "next_state", "bag_sha256"} <= names
    found = {str(path): literals(tree) & names for path, tree in modules() if path != SCHEMA}
    assert {path: texts for path, texts in found.items() if texts} == {}


@pytest.mark.parametrize("room", ROOMS)
def test_what_handles_data_sets_writes_no_name_of_a_column(room: str) -> None:
    found = {
        str(path): literals(tree) & (set(Column) - KEYS_OF_JSON)
        for path, tree in modules()
        if path.is_relative_to(SOURCE / room)
    }
    assert len(found) >= 4
    assert {path: texts for path, texts in found.items() if texts} == {}
