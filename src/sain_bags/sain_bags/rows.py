"""Pushes of a recording as rows of a data set, and why a push is none."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from sain_bags.pairing import Paired
from sain_core.dynamics import Dynamics
from sain_core.errors import ErrorCode, InvalidInputError, SainError
from sain_core.push import check_predictable
from sain_core.scene import MASS, POSITION, RADIUS, STATE_NAMES, TARGET, check_scenes
from sain_core.shards import MOVED
from sain_core.types import PushArray, Scene
from sain_core.wire import decode_disks, decode_goal, decode_push

FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
FROM_SCENES: Final = "scenes"
COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction
NO_GOAL: Final = (np.full(2, np.nan), float("nan"))

# Why a push is no row.
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


@dataclass(frozen=True)
class Row:
    """One push and what came of it; scenes (N, 8)."""

    state: Scene
    action: PushArray
    physics_next: Scene
    next_state: Scene
    moved: bool  # the target moved by 2 mm or more
    goal: np.ndarray  # (2,) [m], NaN: none was given
    tolerance: float  # [m], NaN likewise
    push_id: int
    episode_id: int  # as the recording has it
    scene_id: int  # of the scene before
    outcome: int  # `ErrorCode` of the result; 0: there is none
    stamps: tuple[int, int]  # [ns] simulated time of the scenes before and after
    log_time: int  # [ns since the epoch] when the push was first heard of
    duration: float  # [s] simulated, from start to settled
    source: str  # `FROM_RESULT` or `FROM_SCENES`
    physics_source: str  # the model that predicted, `COMPUTED` before it if that was done here


class _UnpredictableError(SainError):
    """A push that the prior cannot predict."""


class RowMaker:
    """Makes rows of pushes, or says why one is none."""

    def __init__(
        self,
        prior: Callable[[], Dynamics],
        prior_name: str,
        moved_only: bool = False,
        keep_unsettled: bool = False,
    ) -> None:
        """Filter so, and predict with this prior, made when it is needed first, what is not."""
        self._make_prior, self._prior_name = prior, prior_name
        self._prior: Dynamics | None = None
        self._moved_only, self._keep_unsettled = moved_only, keep_unsettled

    def row(self, paired: Paired) -> Row | Dropped:
        """Return the row of a push, or why there is none."""
        about = f"push {paired.push_id} of episode {paired.place[0]}"
        if paired.refused:
            result = paired.result
            name = _code_name(result.error_code)
            return Dropped(REFUSED, f"{about}: {name}: {result.error_message}")
        if paired.repeated:
            return Dropped(REPEATED, about)
        if paired.ambiguous:
            return Dropped(AMBIGUOUS, about)
        before, after = _scenes(paired)
        if before is None or after is None:
            return Dropped(UNANSWERED, about)
        if not (self._keep_unsettled or (before.settled and after.settled)):
            return Dropped(UNSETTLED, about)
        try:
            row = self._row(paired, before, after)
        except InvalidInputError as error:
            return Dropped(SENSELESS, f"{about}: {error}")
        except _UnpredictableError as error:
            return Dropped(UNPREDICTED, f"{about}: {error}")
        return Dropped(NOT_MOVED, about) if self._moved_only and not row.moved else row

    def _row(self, paired: Paired, before: Any, after: Any) -> Row:
        state, next_state = _scene(before, "before"), _scene(after, "after")
        if len(state) != len(next_state):
            raise InvalidInputError(f"{len(state)} disks before the push, {len(next_state)} after")
        action = decode_push(paired.push)
        physics_next, physics_source = self._physics(paired, state, action)
        result = paired.result
        stamps = (_nanoseconds(before), _nanoseconds(after))
        goal, tolerance = _goal(paired.goal)
        travel = np.hypot(*(next_state[TARGET, POSITION] - state[TARGET, POSITION]))
        return Row(
            state=state,
            action=action,
            physics_next=physics_next,
            next_state=next_state,
            moved=bool(travel >= MOVED),
            goal=goal,
            tolerance=tolerance,
            push_id=paired.push_id,
            episode_id=paired.place[0] if result is None else result.episode_id,
            scene_id=before.scene_id,
            outcome=int(ErrorCode.UNKNOWN if result is None else result.error_code),
            stamps=stamps,
            log_time=paired.log_time,
            duration=1e-9 * (stamps[1] - stamps[0]) if result is None else result.duration,
            source=FROM_SCENES if result is None else FROM_RESULT,
            physics_source=physics_source,
        )

    def _physics(self, paired: Paired, state: Scene, action: PushArray) -> tuple[Scene, str]:
        prediction = paired.prediction
        if prediction is not None and prediction.error_code == ErrorCode.OK:
            predicted = decode_disks(prediction.disks, "prediction")
            if len(predicted) != len(state):
                raise InvalidInputError(f"{len(state)} disks, {len(predicted)} in the prediction")
            return predicted, prediction.model
        if self._prior is None:
            self._prior = self._make_prior()
        try:
            scenes, pushes = check_scenes(state[None]), check_predictable(action[None])
            computed = self._prior.step(scenes, pushes)[0]
        except SainError as error:
            raise _UnpredictableError(str(error)) from error
        if not np.isfinite(computed).all():
            raise _UnpredictableError(f"{self._prior_name} predicted NaN or Inf")
        return computed, COMPUTED + self._prior_name


def _scenes(paired: Paired) -> tuple[Any, Any]:
    """Return the messages of the scenes before and after a push."""
    if paired.result is None:
        return paired.before, paired.after
    return paired.result.before, paired.result.after


def _scene(message: Any, name: str) -> Scene:
    scene = decode_disks(message.disks, f"scene {name}")
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0.0).any():
            raise InvalidInputError(f"scene {name}: a {STATE_NAMES[column]} is not positive")
    return scene


def _goal(message: Any) -> tuple[np.ndarray, float]:
    return NO_GOAL if message is None else (decode_goal(message), float(message.tolerance))


def _nanoseconds(scene: Any) -> int:
    stamp = scene.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _code_name(code: int) -> str:
    return ErrorCode(code).name if code in set(ErrorCode) else f"error {code}"
