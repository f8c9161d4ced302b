"""The ids of episodes, scenes and pushes: each push is executed at most once, one at a time."""

from collections import OrderedDict
from typing import Final

from sain_core.errors import (
    BusyError,
    DuplicatePushError,
    InvalidInputError,
    StaleSceneError,
    UnknownEpisodeError,
)

REMEMBERED_PUSHES: Final = 100_000  # an older push names a stale scene in any case


class Session:
    """The ids of episodes and scenes, and the push under way. Not for use by two threads.

    `episode_id` counts resets from 1. `scene_id` counts resets and executed pushes, and never
    starts again: an episode and a scene name one moment.
    """

    def __init__(self) -> None:
        """Start before the first episode."""
        self.episode_id = 0
        self.scene_id = 0
        self.busy_with: int | None = None
        self._seen: OrderedDict[int, None] = OrderedDict()

    @property
    def busy(self) -> bool:
        """Whether a push is under way."""
        return self.busy_with is not None

    def go_on_from(self, episode_id: int, scene_id: int, last_push: int = 0) -> None:
        """Continue with the ids of another process; its last push is known, too."""
        self.episode_id, self.scene_id = episode_id, scene_id
        if last_push:
            self._remember(last_push)

    def check_idle(self) -> None:
        """Raise `BusyError` if a push is under way."""
        if self.busy:
            raise BusyError(f"push {self.busy_with} is under way; reset when it has ended")

    def begin_episode(self) -> None:
        """Count a reset; raises as `check_idle`."""
        self.check_idle()
        self.episode_id += 1
        self.scene_id += 1

    def admit(self, push_id: int, episode_id: int, scene_id: int) -> None:
        """Take a push as the one under way, until `finish`; a refusal uses up its id, too."""
        if push_id == 0:
            raise InvalidInputError("push_id is 0; ids start at 1")
        if push_id in self._seen:
            raise DuplicatePushError(f"push {push_id} came before; each push needs a new id")
        self._remember(push_id)
        if self.busy:
            raise BusyError(f"push {self.busy_with} is under way; send push {push_id} anew later")
        if episode_id != self.episode_id:
            raise UnknownEpisodeError(
                f"push {push_id} is for episode {episode_id}; episode {self.episode_id} is running"
            )
        if scene_id != self.scene_id:
            raise StaleSceneError(
                f"push {push_id} was planned from scene {scene_id}; it is scene {self.scene_id} now"
            )
        self.busy_with = push_id

    def finish(self, executed: bool) -> None:
        """End the push under way; one that was executed makes a new scene."""
        self.busy_with = None
        if executed:
            self.scene_id += 1

    def _remember(self, push_id: int) -> None:
        self._seen[push_id] = None
        if len(self._seen) > REMEMBERED_PUSHES:
            self._seen.popitem(last=False)
