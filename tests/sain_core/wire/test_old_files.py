"""Files of before are read in the form of today, once, at the edge."""

from types import SimpleNamespace

import numpy as np
import pytest

from sain_core.push import LENGTH, PUSH_SIZE, make_push, pushed_bodies
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import Column, row_bodies
from sain_core.wire import decode_goal, decode_plan, decode_push
from sain_core.wire.old_files import converted_message, converted_rows
from tests.old_files.reading import FOLDER, KINDS, expected, five

PLAN, PUSH = "sain_interfaces/msg/Plan", "sain_interfaces/msg/Push"
OLD = {Column.STATE: np.zeros((2, 24)), Column.ACTION: np.array([[0.1, 0.2, 0.05], [3.0, 0, 0]])}


@pytest.mark.parametrize("kind", KINDS)
def test_an_old_data_set_has_pushes_of_five_numbers(kind: str) -> None:
    with np.load(FOLDER / f"{kind}_data" / "shard-00000.npz") as archive:
        old = dict(archive)
    new = converted_rows(old)
    np.testing.assert_array_equal(new[Column.ACTION], five(expected(f"{kind}_data")["action"]))
    assert new.keys() == old.keys() - {"body"}
    assert len(set(pushed_bodies(new[Column.ACTION]).tolist())) == (2 if kind == "shapes" else 1)
    again = converted_rows(new)
    assert all(again[name] is new[name] for name in new)


def test_marks_become_the_names_of_shapes() -> None:
    marked = {**OLD, "cubes": np.array([[0, 1, 0], [0, 0, 1]], dtype=bool)}
    rows = converted_rows(marked)
    assert row_bodies(rows) == [
        Bodies.named(["disk", "cube", "disk"]),
        Bodies.named(["disk", "disk", "cube"]),
    ]
    assert "cubes" not in rows and rows[Column.ACTION][0, LENGTH] == 0.05


def test_messages_get_the_fields_that_they_lack() -> None:
    push = SimpleNamespace(location=0.1, angle=0.2, length=0.05)
    converted = decode_push(converted_message(PUSH, push))
    np.testing.assert_array_equal(converted, make_push(0.1, 0.2, 0.05))
    push.body, push.speed = 2, 0.05
    converted = decode_push(converted_message(PUSH, push))
    np.testing.assert_array_equal(converted, make_push(0.1, 0.2, 0.05, body=2, speed=0.05))
    goal = SimpleNamespace(x=0.8, y=0.0, tolerance=0.02)
    assert decode_goal(converted_message("sain_interfaces/msg/Goal", goal)).is_place


@pytest.mark.parametrize(("bodies", "pushed"), [(None, [0, 0]), ([], [0, 0]), ([1, 0], [1, 0])])
def test_plans_get_pushes_of_five_numbers(bodies: list[int] | None, pushed: list[int]) -> None:
    plan = SimpleNamespace(horizon=2, disks=2, pushes=[0.1] * 6, predicted=[0.0] * 32)
    if bodies is not None:
        plan.push_bodies = bodies
    pushes, _ = decode_plan(converted_message(PLAN, plan))
    assert pushes.shape == (2, PUSH_SIZE) and pushed_bodies(pushes).tolist() == pushed
    again, _ = decode_plan(converted_message(PLAN, plan))
    np.testing.assert_array_equal(again, pushes)
