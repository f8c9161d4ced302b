"""Why a push is no row of a data set."""

from collections.abc import Callable
from typing import Final, NamedTuple

from numpy import ndarray

from sain_bags.transitions.message_fields import DISKS
from sain_bags.transitions.paired_pushes import GOAL_FIELDS, OK, PairedPushes, PendingPush
from sain_core.errors import ErrorCode, InvalidInputError
from sain_core.push import PUSH_NAMES
from sain_core.scene import MASS, RADIUS, STATE_NAMES
from sain_core.types import Scene
from sain_core.wire import check_disks, check_fields

REFUSED: Final = "refused"
REPEATED: Final = "push id used before"
UNANSWERED: Final = "no result, and no settled scenes around it"
AMBIGUOUS: Final = "no result, and another push from the same scene"
UNSETTLED: Final = "scene before or after not settled"
SENSELESS: Final = "makes no sense"
UNPREDICTED: Final = "not predicted, and the prior cannot"
NOT_MOVED: Final = "target moved by less than 2 mm"


class Dropped(NamedTuple):
    """A push that is no row, and why."""

    reason: str
    detail: str


def why_no_row(push: PendingPush) -> Dropped | None:
    """Return why a push is no row; None: it may be one."""
    named = named_push(push.push_id, push.planned_from[0])
    if push.result is not None and push.code != OK:
        table, row = push.result
        message = table.columns["error_message"][row]
        return Dropped(REFUSED, f"{named}: {_code_name(push.code)}: {message}")
    if push.repeated:
        return Dropped(REPEATED, named)
    if push.ambiguous:
        return Dropped(AMBIGUOUS, named)
    if push.result is None and (push.before is None or push.after is None):
        return Dropped(UNANSWERED, named)
    return None


def drop(
    pushes: PairedPushes,
    chosen: ndarray,
    reason: str,
    why: Callable[[PairedPushes, int], str] | None,
    dropped: dict[int, Dropped],
) -> None:
    """Add some pushes to those that are no rows, with the reason and a detail of each, if any."""
    for push in chosen.tolist():
        named = _about(pushes, push)
        named = f"{named}: {why(pushes, push)}" if why else named
        dropped[int(pushes.places[push])] = Dropped(reason, named)


def why_senseless(pushes: PairedPushes, push: int) -> str:
    """Return what is wrong with the scenes, the push or the prediction."""
    try:
        before = _possible(pushes.before.one(push), "scene before")
        after = _possible(pushes.after.one(push), "scene after")
        if len(before) != len(after):
            raise InvalidInputError(f"{len(before)} disks before the push, {len(after)} after")
        check_fields(pushes.actions[push], PUSH_NAMES, "push")
        if pushes.bodies[push] >= len(before):
            raise InvalidInputError(
                f"it is against body {pushes.bodies[push]}; the scene has bodies"
                f" 0 to {len(before) - 1}"
            )
        if pushes.predictions is not None and pushes.predicted[push]:
            table, rows = pushes.predictions
            disks = table.disks[DISKS]
            count = int(disks.counts[rows[push]])
            check_disks(disks.scenes(rows[[push]], count)[0], "prediction")
            raise InvalidInputError(f"{len(before)} disks, {count} in the prediction")
    except InvalidInputError as error:
        return str(error)
    raise AssertionError(f"nothing is wrong with {_about(pushes, push)}")


def why_no_goal(pushes: PairedPushes, push: int) -> str:
    """Return what is wrong with the goal."""
    try:
        check_fields(pushes.goal_values[push], GOAL_FIELDS, "goal")
    except InvalidInputError as error:
        return str(error)
    raise AssertionError(f"nothing is wrong with the goal of {_about(pushes, push)}")


def named_push(push_id: int, episode: int) -> str:
    """Return in words which push it is."""
    return f"push {push_id} of episode {episode}"


def _about(pushes: PairedPushes, push: int) -> str:
    ids = pushes.ids[push]
    return named_push(int(ids["push_id"]), int(ids["planned_in"]))


def _possible(scene: Scene, name: str) -> Scene:
    check_disks(scene, name)
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0.0).any():
            raise InvalidInputError(f"{name}: a {STATE_NAMES[column]} is not positive")
    return scene


def _code_name(code: int) -> str:
    return ErrorCode(code).name if code in set(ErrorCode) else f"error {code}"
