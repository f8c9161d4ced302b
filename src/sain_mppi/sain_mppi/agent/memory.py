"""What the planner remembers of the episode that it is in: its pushes and where they led."""

from sain_core.history import PushHistory
from sain_core.types import PushArray, Scalars, Scene

MOST_PUSHES = 20  # the latest; more would tell little and cost time in every plan


class EpisodeMemory:
    """The pushes of the latest episode. Another episode's begin anew."""

    def __init__(self) -> None:
        """Begin without an episode."""
        self._episode_id: int | None = None
        self._history: PushHistory | None = None

    def add(
        self,
        episode_id: int,
        scene: Scene,
        push: PushArray,
        next_scene: Scene,
        noise: Scalars | None = None,
    ) -> None:
        """Remember a push (5,) that led from one settled scene (N, 8) to another.

        `noise` (N,) [m]: see `PushHistory`.

        Raises:
            InvalidInputError: it cannot be; nothing is remembered of it.
        """
        past = self._history if episode_id == self._episode_id else None
        history = (past or PushHistory.empty(len(scene))).then(scene, push, next_scene, noise)
        self._episode_id, self._history = episode_id, history.latest(MOST_PUSHES)

    def of(self, episode_id: int, disks: int) -> PushHistory:
        """Return what is known of an episode of so many disks: nothing, unless it is the latest."""
        history = self._history
        if history is None or episode_id != self._episode_id or history.disks != disks:
            return PushHistory.empty(disks)
        return history
