"""The one converter of files of before: data sets and recordings in the form that they have today.

Readers call it at the edge; nothing behind them has a second form. Before pushes had five numbers,
a push was a location, an angle and a length, in data sets and in messages. The body stood beside
them, or there was none and it was body 0. All pushes had the speed `DEFAULT_SPEED`.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.push import DEFAULT_SPEED, PATH, make_push
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import BETWEEN
from sain_core.shapes.library import shape_names
from sain_core.shapes.solids import DISK
from sain_core.transitions import Column, Columns

PATH_SIZE: Final = PATH.stop - PATH.start
OLD_WIDTHS: Final = (PATH_SIZE, PATH_SIZE + 1)  # numbers of a push: a fourth was its body
BODY_COLUMN: Final = "body"  # (M,) beside the action, where not all pushes were against body 0
MARKS: Final = "s"  # ends a column (M, N) that states which bodies are, for example, ``cubes``

# Fields that older definitions of messages lack, and what such messages meant.
PUSH_FIELDS: Final = {"body": 0, "speed": DEFAULT_SPEED}
GOAL_FIELDS: Final[dict[str, Any]] = {
    "goal_id": 0, "poses": (), "keep": (), "keep_tolerance": 0.0
}  # fmt: skip


def converted_rows(columns: Columns) -> Columns:
    """Return the columns of a data set with pushes of five numbers and bodies by their names.

    Columns that cannot be those of a data set stay as they are: readers refuse them.

    Raises:
        DatasetError: the column of bodies has not one number for each push.
    """
    rows = _with_names(columns)
    action = rows.get(Column.ACTION)
    if action is None or action.ndim != 2 or action.shape[1] not in OLD_WIDTHS:
        return rows
    if action.dtype.kind not in "fiu":
        return rows
    body = rows.pop(BODY_COLUMN, action[:, PATH_SIZE] if action.shape[1] > PATH_SIZE else 0)
    if np.shape(body) not in ((), (len(action),)) or np.asarray(body).dtype.kind not in "fiu":
        raise DatasetError(
            f"{BODY_COLUMN} is {np.asarray(body).dtype} of shape {np.shape(body)}; it should be"
            f" integers of shape ({len(action)},)"
        )
    return rows | {str(Column.ACTION): make_push(*action[:, :PATH_SIZE].T, body=body)}


def _with_names(columns: Columns) -> Columns:
    """Return columns with the shapes by name where marks state which bodies are no disks."""
    rows, state = dict(columns), columns.get(Column.STATE)
    if Column.SHAPES in rows or state is None or not any(key.endswith(MARKS) for key in rows):
        return rows
    marks = {name: rows.pop(f"{name}{MARKS}") for name in shape_names() if f"{name}{MARKS}" in rows}
    if marks:
        names = np.full((len(state), state[0].size // STATE_SIZE), DISK, dtype=object)
        for name, marked in marks.items():
            names[np.asarray(marked, dtype=bool)] = name
        rows[str(Column.SHAPES)] = np.array([BETWEEN.join(row) for row in names])
    return rows


def converted_message(kind: str, message: Any) -> Any:
    """Return a recorded message of a type with all that its definition has today, as decoded."""
    if kind == "sain_interfaces/msg/Push":
        _complete(message, PUSH_FIELDS)
    elif kind == "sain_interfaces/msg/PushResult":
        _complete(message.push, PUSH_FIELDS)
        nothing = SimpleNamespace(model="", error_code=0, error_message="", disks=[])
        _complete(message, {"prediction": nothing})
    elif kind == "sain_interfaces/msg/Goal":
        _complete(message, GOAL_FIELDS)
    elif kind == "sain_interfaces/msg/Plan":
        _convert_plan(message)
    return message


def _complete(message: Any, fields: Mapping[str, Any]) -> None:
    for name, value in fields.items():
        if not hasattr(message, name):
            setattr(message, name, value)


def _convert_plan(message: Any) -> None:
    """Give a plan its pushes in five numbers; one whose sizes do not fit stays as it is."""
    paths, horizon = np.asarray(message.pushes, dtype=np.float64), message.horizon
    if not horizon or paths.size != PATH_SIZE * horizon:
        return
    bodies: ndarray | int = np.asarray(getattr(message, "push_bodies", ()))
    if np.size(bodies) not in (0, horizon):
        return
    message.pushes = (
        make_push(*paths.reshape(-1, PATH_SIZE).T, body=bodies if np.size(bodies) else 0)
        .ravel()
        .tolist()
    )
