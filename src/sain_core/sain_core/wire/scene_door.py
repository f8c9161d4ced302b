"""What a robot may take for the scene on its table: the latest good one, never a bad one.

No middleware here. Scenes go in by `take`; a bad one raises, and what is held stays as it was.
"""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np

from sain_core import wire
from sain_core.errors import InvalidInputError, StaleSceneError
from sain_core.scene import POSITION, VELOCITY
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.wire.bodies import check_unchanged

OLD: Final = 0.5  # [s], age of a scene above which no stroke is made from it
ANEW: Final = 1.0  # [s] without a scene, after which stamps and ids may begin anew
MOVED: Final = 0.005  # [m], of a body since the push was planned


@dataclass(frozen=True, eq=False)
class SeenScene:
    """A scene that was observed, and checked."""

    disks: Scene  # (N, 8)
    episode_id: int = 0  # number of its episode
    scene_id: int = 0  # number of the scene
    settled: bool = True  # whether the bodies are at rest, as the message states
    stamp: float = 0.0  # of the observation [s], by the clock of the headers
    came: float = 0.0  # when it came [s], of a steady clock
    message: Any = None  # as it came

    @classmethod
    def of(cls, message: Any, came: float = 0.0) -> Self:
        """Return the scene of a message; raises `InvalidInputError`."""
        stamp = wire.decode_stamp(message.header.stamp) * 1e-9
        ids = int(message.episode_id), int(message.scene_id)
        return cls(wire.decode_scene(message), *ids, message.settled, stamp, came, message)

    @property
    def ids(self) -> tuple[int, int]:
        """The numbers of its episode and scene."""
        return self.episode_id, self.scene_id

    @property
    def at_rest(self) -> bool:
        """Whether all bodies are seen at rest: none has a velocity then."""
        return not self.disks[:, VELOCITY].any()

    def age(self, now: float, clock: float) -> float:
        """Return how old [s] it is at two times [s]: of a steady clock, and of that of headers."""
        return max(now - self.came, clock - self.stamp)


class SceneDoor:
    """Holds the latest good scene and the bodies of its episode. Times are in seconds.

    Attributes:
        seen: the latest good scene; None: none came.
        trouble: why the scene after it was refused; empty: it was not.
        bodies: of episode `episode_id`; None: none were stated.
    """

    def __init__(self, old: float = OLD) -> None:
        """Make no stroke from a scene that is older than this [s]."""
        self._old = old
        self.seen: SeenScene | None = None
        self.trouble = ""
        self.bodies: Bodies | None = None
        self.episode_id = 0
        self._settled: SeenScene | None = None  # the latest such one with the ids of `seen`

    def state_bodies(self, bodies: Bodies, episode_id: int, now: float) -> None:
        """Take the bodies of an episode; a scene of it with another number of them was bad.

        Raises `InvalidInputError` where an episode of which scenes come has other bodies.
        """
        goes_on = self.seen is not None and now <= self.seen.came + ANEW
        if goes_on and self.bodies is not None and episode_id == self.episode_id:
            check_unchanged(self.bodies, bodies)
        self.bodies, self.episode_id = bodies, episode_id
        if self.seen is not None and (text := self._miscounted(self.seen)):
            self.seen, self._settled, self.trouble = None, None, text

    def hold(self, seen: SeenScene, bodies: Bodies) -> None:
        """Hold a scene of who sees the bodies by itself."""
        self.seen, self.trouble, self._settled = seen, "", seen
        self.bodies, self.episode_id = bodies, seen.episode_id

    def take(self, message: Any, now: float, clock: float) -> SeenScene:
        """Hold a scene that came at two times, of a steady clock and of that of headers.

        Raises `InvalidInputError`: what is wrong with it; then the one before stays.
        """
        try:
            seen = SeenScene.of(message, now)
            if text := self._miscounted(seen) or self._out_of_order(seen, clock):
                raise InvalidInputError(text)
        except InvalidInputError as error:
            self.trouble = str(error)
            raise
        if seen.settled and seen.at_rest:
            self._settled = seen
        elif self._settled is not None and self._settled.ids != seen.ids:
            self._settled = None
        self.seen, self.trouble = seen, ""
        return seen

    def check_push(self, now: float, clock: float) -> None:
        """Raise `StaleSceneError` where no push may begin from what is held."""
        if text := self._unseen(now, clock) or self._unsettled(now, clock):
            raise StaleSceneError(text)

    def check_stroke(self, planned: SeenScene, now: float, clock: float) -> None:
        """Raise `StaleSceneError` where bodies are not where they were when a push was planned.

        The push is under way, so the scene is not settled.
        """
        text, seen = self._unseen(now, clock), self.seen
        if text or seen is None:
            raise StaleSceneError(text)
        if seen.ids[0] != planned.ids[0]:
            raise StaleSceneError(
                f"episode {seen.ids[0]} has begun; the push was planned in episode {planned.ids[0]}"
            )
        if len(seen.disks) != len(planned.disks):
            raise StaleSceneError(
                f"there are {len(seen.disks)} bodies; the push was planned with"
                f" {len(planned.disks)}"
            )
        apart = np.linalg.norm((seen.disks - planned.disks)[:, POSITION], axis=1)
        if apart.max() > MOVED:
            text = f"body {int(np.argmax(apart))} was moved by {1e3 * apart.max():.0f} mm"
            raise StaleSceneError(f"{text} since the push was planned")

    def _unseen(self, now: float, clock: float) -> str:
        """Return in words that no good scene is current; empty: one is."""
        if self.trouble:
            return f"the latest scene was refused: {self.trouble}"
        if self.seen is None:
            return "no scene came yet"
        if (age := self.seen.age(now, clock)) <= self._old:
            return ""
        return f"the latest scene is old: {age:.1f} s since the last one; allowed: {self._old:g} s"

    def _unsettled(self, now: float, clock: float) -> str:
        """Return in words that the bodies are not at rest; empty: they are."""
        text, settled = "the latest scene is not settled", self._settled
        if settled is None:
            return text
        if (age := settled.age(now, clock)) <= self._old:
            return ""
        return f"{text}: {age:.1f} s since the last settled one; allowed: {self._old:g} s"

    def _miscounted(self, seen: SeenScene) -> str:
        """Return in words that bodies came or went within an episode; empty: none did."""
        count, episode = len(seen.disks), seen.ids[0]
        if self.bodies is not None and self.episode_id == episode:
            stated = len(self.bodies)
        elif self.seen is not None and self.seen.ids[0] == episode and not self._anew(seen):
            stated = len(self.seen.disks)
        else:
            return ""
        return "" if count == stated else f"it has {count} bodies; episode {episode} has {stated}"

    def _out_of_order(self, seen: SeenScene, clock: float) -> str:
        """Return in words that a scene is from another time; empty: it is not."""
        if seen.stamp > clock + self._old:
            return (
                f"its stamp is {seen.stamp - clock:.1f} s in the future; is use_sim_time the same"
                " for all nodes?"
            )
        last = self.seen
        if last is None or self._anew(seen):
            return ""
        if seen.ids < last.ids:
            return (
                f"it is scene {seen.ids[1]} of episode {seen.ids[0]}, and came after scene"
                f" {last.ids[1]} of episode {last.ids[0]}"
            )
        if seen.stamp < last.stamp:
            return f"its stamp is {last.stamp - seen.stamp:.3f} s before that of the last scene"
        return ""

    def _anew(self, seen: SeenScene) -> bool:
        return self.seen is not None and seen.came > self.seen.came + ANEW
