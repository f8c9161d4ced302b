"""What episodes of a recording are called."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from sain_bags.reading.reader import Bag

EPISODES_KEY: Final = "episodes"  # of the custom data: what `closed_loop` calls each with a goal


class EpisodePart(NamedTuple):
    """An episode of a graph, or the part of it towards one of its goals."""

    namespace: str
    episode_id: int
    has_goal: bool
    goal: int = 1  # number of the goal, 0: none was given yet, ...
    goals: int = 1  # ... of so many in a row


def episode_titles(bag: Bag, parts: Sequence[EpisodePart]) -> list[str]:
    """Return a title for each part: graph, number, and the recording's own name."""
    count = sum(part.has_goal and part.goal == 1 for part in parts)
    names = bag.custom_data.get(EPISODES_KEY, "").split()
    rest = iter(names if len(names) == count else [""] * count)
    several = len({part.namespace for part in parts}) > 1
    titles, name = [], ""
    for part in parts:
        if part.goal <= 1:
            name = next(rest).replace(":", " ") if part.has_goal else ""
        graph = (part.namespace or "/") if several else ""
        goal = f"goal {part.goal} of {part.goals}" if part.goals > 1 else ""
        goal = goal if part.goal else "no goal yet"
        words = (graph, f"Episode {part.episode_id}", name, goal)
        titles.append(" · ".join(filter(None, words)))
    return titles
