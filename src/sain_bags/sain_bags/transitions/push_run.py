"""Executed pushes one after the other, of each of which all that is said is said in one go."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from sain_bags.transitions.tables import Table

ANY_EPISODE = 0  # in a goal: it holds for all
NONE = -1  # in place of a row

Where = tuple[Table, int]  # a message: the table that it is in, and its row


@dataclass(frozen=True)
class GoalRun:
    """Goals that were given between the pushes of a run."""

    table: Table
    rows: ndarray  # (G,)
    spots: ndarray  # (G,) growing, comparable with those of pushes

    def items(self) -> Iterator[tuple[int, Where]]:
        """Yield each episode's number with where its goal stands, in their order."""
        for row in self.rows.tolist():
            yield int(self.table.columns["episode_id"][row]), (self.table, row)


@dataclass
class PushRun:
    """R pushes, in their order."""

    results: Table
    rows: ndarray  # (R,) in results
    predictions: Table | None  # None: none are expected
    prediction_rows: ndarray  # (R,)
    times: ndarray  # (R,) [ns since the epoch], of the first message about each
    spots: ndarray  # (R,) growing, of the last
    goals: list[Where] = field(default_factory=list)
    goal_of: ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))  # (R,) in goals

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.rows)

    def column(self, name: str) -> ndarray:
        """Return a column of the results, (R,)."""
        return self.results.columns[name][self.rows]

    def has_place(self, episode: int, scene: int) -> bool:
        """Tell whether one of them was planned from a scene."""
        episodes, scenes = self.column("push.episode_id"), self.column("push.scene_id")
        return bool(((episodes == episode) & (scenes == scene)).any())

    def part(self, chosen: slice) -> "PushRun":
        """Return some of them, one after the other."""
        return PushRun(
            self.results,
            self.rows[chosen],
            self.predictions,
            self.prediction_rows[chosen],
            self.times[chosen],
            self.spots[chosen],
        )

    def find_goals(self, given: GoalRun | None, earlier: Mapping[int, Where]) -> None:
        """Give each push the latest goal of its episode, or else the latest for any.

        Args:
            given: goals between these pushes.
            earlier: those before, by episode.
        """
        found = [where for _, where in given.items()] if given else []
        episodes = self.column("episode_id")
        chosen = self._latest(given, episodes)
        general = self._latest(given, np.full_like(episodes, ANY_EPISODE))
        for episode in np.unique(episodes[chosen == NONE]).tolist():
            if episode in earlier:
                chosen[(episodes == episode) & (chosen == NONE)] = len(found)
                found.append(earlier[episode])
        chosen = np.where(chosen == NONE, general, chosen)
        if ANY_EPISODE in earlier:
            chosen[chosen == NONE] = len(found)
            found.append(earlier[ANY_EPISODE])
        self.goals, self.goal_of = found, chosen

    def _latest(self, given: GoalRun | None, episodes: ndarray) -> ndarray:
        """Return which goal was the last that was given for an episode each, (R,)."""
        if given is None or not len(given.rows):
            return np.full(len(self), NONE)
        told = given.table.columns["episode_id"][given.rows]
        _, codes = np.unique(np.concatenate([told, episodes]), return_inverse=True)
        goal_codes, push_codes = codes[: len(told)], codes[len(told) :]
        most = int(max(given.spots[-1], self.spots[-1])) + 1
        keys = goal_codes * most + given.spots  # by episode, then by time
        order = np.argsort(keys)
        place = np.searchsorted(keys[order], push_codes * most + self.spots) - 1
        found = order[place]  # place -1 is no goal's: it is found out below
        return np.where((place >= 0) & (goal_codes[found] == push_codes), found, NONE)
