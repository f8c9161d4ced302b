"""The pushes of an episode: what was planned, predicted and seen of each, in any order."""

from dataclasses import dataclass

from sain_core.types import Scene
from sain_live.state import MOST_POINTS, LiveCurves, LiveResult, largest_error

UNKNOWN = float("nan")


@dataclass(eq=False)
class PushStory:
    """All about one push, as far as it has come."""

    distance: float = UNKNOWN  # [mm], before it
    left: float = UNKNOWN  # [mm], after it
    planning: float = UNKNOWN  # [ms]
    planned: Scene | None = None
    physics: Scene | None = None
    before: Scene | None = None
    after: Scene | None = None


class Stories:
    """The pushes of an episode, by their ids."""

    def __init__(self) -> None:
        """Begin with none."""
        self._stories: dict[int, PushStory] = {}

    def clear(self) -> None:
        """Begin another episode."""
        self._stories.clear()

    def of(self, push_id: int) -> PushStory:
        """Return what is known of a push."""
        if push_id not in self._stories and len(self._stories) >= MOST_POINTS:
            del self._stories[next(iter(self._stories))]
        return self._stories.setdefault(push_id, PushStory())

    def result(self, push_id: int) -> LiveResult | None:
        """Return a push that was carried out, beside its predictions; None: it was not yet."""
        story = self.of(push_id)
        if story.after is None:
            return None
        return LiveResult(push_id, story.after, story.before, story.planned, story.physics)

    def curves(self) -> LiveCurves:
        """Return the charts."""
        stories = list(self._stories.values())
        if not stories:
            return LiveCurves()
        planned, physics = (
            (
                UNKNOWN,
                *(
                    UNKNOWN if s.after is None else largest_error(getattr(s, name), s.after)
                    for s in stories
                ),
            )
            for name in ("planned", "physics")
        )
        return LiveCurves(
            (*(s.distance for s in stories), stories[-1].left),
            planned,
            physics,
            (UNKNOWN, *(s.planning for s in stories)),
        )
