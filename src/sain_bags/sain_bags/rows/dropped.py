"""Why a push is no row of a data set."""

from math import pi
from typing import Final, NamedTuple

import numpy as np

from sain_bags.rows.results import RecordedScenes, Results
from sain_core.errors import ErrorCode, InvalidInputError, OutOfRangeError
from sain_core.guarding.untrusted import one_line, shown
from sain_core.push import PUSH_NAMES, check_predictable
from sain_core.scene import MASS, RADIUS, STATE_NAMES, STATE_SIZE, THETA
from sain_core.transitions import LIMITS as UNITS
from sain_core.transitions import SAME_KIND, changed_kinds
from sain_core.types import Scene
from sain_core.wire import FRAMES, check_disks, check_fields

REFUSED: Final = "refused"
REPEATED: Final = "push id used before"
UNSETTLED: Final = "scene before or after not settled"
SENSELESS: Final = "makes no sense"
LONGEST: Final = 3600.0  # [s], of a push
LIMITS: Final = {**UNITS, THETA: (-2.0 * pi, 2.0 * pi)}  # of columns of a scene
MIXED: Final = "made of several pushes: its ids differ"
CHANGED: Final = "mass or radius changed by the push"
UNPREDICTED: Final = "not predicted, and the prior cannot"
NOT_MOVED: Final = "target moved by less than 2 mm"


class Dropped(NamedTuple):
    """A push that is no row, and why."""

    reason: str
    detail: str


def named_push(results: Results, push: int) -> str:
    """Return in words which push it is."""
    episode = int(results.table.columns["push.episode_id"][push])
    return f"push {int(results.push_ids[push])} of episode {episode}"


def why_refused(results: Results, push: int) -> str:
    """Return the error of a refused push."""
    code = int(results.codes[push])
    name = ErrorCode(code).name if code in set(ErrorCode) else f"error {code}"
    return f"{name}: {one_line(results.messages[push])}"


def why_mixed(results: Results, push: int) -> str:
    """Return which id of a result differs from its own."""
    column, own = next((one, own) for one, own, same in results.ids if not same[push])
    columns = results.table.columns
    return f"{column} is {columns[column][push]}; {own} is {columns[own][push]}"


def why_changed(results: Results, push: int) -> str:
    """Return how a mass or a radius was changed most."""
    before, after = results.before.one(push), results.after.one(push)
    assert before is not None and after is not None
    body, place = np.unravel_index(changed_kinds(before, after).argmax(), (len(before), 2))
    column = (MASS, RADIUS)[place]
    return (
        f"{STATE_NAMES[column]} of body {body} is {before[body, column]:g} before and"
        f" {after[body, column]:g} after it; allowed: {100 * SAME_KIND:g} % of difference"
    )


def why_senseless(results: Results, push: int) -> str:
    """Return what is wrong with the scenes, the push or the prediction."""
    try:
        before = _possible(results.before, push, "scene before")
        after = _possible(results.after, push, "scene after")
        if len(before) != len(after):
            raise InvalidInputError(f"{len(before)} disks before the push, {len(after)} after")
        check_fields(results.actions[push], PUSH_NAMES, "push")
        if results.bodies[push] >= len(before):
            raise InvalidInputError(
                f"it is against body {results.bodies[push]}; the scene has bodies"
                f" 0 to {len(before) - 1}"
            )
        check_predictable(results.actions[push])
        if not 0.0 <= (duration := float(results.durations[push])) <= LONGEST:
            raise InvalidInputError(f"duration is {duration:g} s; allowed: 0 to {LONGEST:g} s")
        count = int(results.predicted_counts[push])
        check_disks(results.physics(np.array([push]), count)[0], "prediction")
        raise InvalidInputError(f"{len(before)} disks, {count} in the prediction")
    except (InvalidInputError, OutOfRangeError) as error:
        return str(error).replace("push ()", "the push")


def _possible(scenes: RecordedScenes, push: int, name: str) -> Scene:
    if (frame := scenes.frames[push]) not in FRAMES:
        raise InvalidInputError(f"{name} is in frame {shown(frame)}; it must be in 'world'")
    scene = scenes.one(push)
    scene = check_disks(np.empty((0, STATE_SIZE)) if scene is None else scene, name)
    for column, (least, most) in LIMITS.items():
        for value in scene[:, column].tolist():
            if not least <= value <= most:
                raise InvalidInputError(
                    f"{name}: {STATE_NAMES[column]} is {value:g}; allowed: {least:g} to {most:g};"
                    " lengths are in m, headings in rad, masses in kg"
                )
    return scene
