"""What a run leaves behind: summary, moving picture and a page, all read back from the bag."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image
from rich.text import Text

from sain_arm.robot.robot import read_robot
from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.writing import write_page
from sain_bags.rows.episodes import Episode, read_episodes
from sain_bringup.display import Display
from sain_bringup.graph import EPISODES_KEY, NAMESPACE_KEY, ROBOT_KEY
from sain_bringup.movie import (
    CAMERA,
    choose_moments,
    describe_distance,
    encode_gif,
    episode_moments,
    render,
)
from sain_core.cli.terminal import FittingTable
from sain_core.output import write_json, write_whole
from sain_core.scene import RADIUS
from sain_core.shapes.bodies import Bodies
from sain_eval.scenes.scenarios import draw_scene
from sain_sim.world.engines import DEFAULT_ROBOT

LIVELY: Final = 8  # pushes: the moving picture shows the longest episode with no more than these

EpisodeSummary = dict[str, Any]


@dataclass(frozen=True)
class PlayedEpisode:
    """One episode of a recording, with the scenario that it was drawn from."""

    scenario: str
    seed: int
    episode: Episode
    goal: int = 0  # number of the goal that this part of an episode is towards; 0: the whole

    def summary(self) -> EpisodeSummary:
        """Return the episode in figures [m, s]; None where there is nothing to take a mean of."""
        executed, aimed = self.episode.executed, self.episode.aimed
        judged = self.episode.judge(self.episode.final)
        assert judged is not None, "played_episodes returns those with a goal"
        times = [push.plan.planning_time for push in executed if push.plan is not None]
        return {
            "scenario": self.scenario,
            "seed": self.seed,
            "success": self.episode.success,
            "goals": len(self.episode.by_goal),
            "goals_in_a_row": self.episode.in_a_row,
            "pushes": len(executed),
            "refused": len(self.episode.pushes) - len(executed),
            "fallbacks": sum(push.plan is not None and push.plan.fallback for push in executed),
            "tolerance": judged.goal.tolerance,
            "final_distance": judged.distance,
            "planning_time": _mean(times),
            "longest_planning_time": max(times, default=None),
            "final_turn": judged.turn if judged.goal.has_heading else None,
            "model_error": _mean([push.error(aimed) for push in self.episode.records]),
            "physics_error": _mean([push.physics_error(aimed) for push in self.episode.records]),
        }

    def last_part(self) -> "PlayedEpisode":
        """Return the episode towards its last goal, which is itself where it has one only."""
        parts = self.episode.by_goal
        return self if len(parts) == 1 else replace(self, episode=parts[-1], goal=len(parts))

    @property
    def title(self) -> str:
        """What it is called in pictures."""
        goal = f", goal {self.goal}" if self.goal else ""
        return f"{self.scenario} {self.seed}".strip() + goal

    @property
    def bodies(self) -> Bodies:
        """Its bodies, of the scenario where the recording has none."""
        bodies = self.episode.bodies
        if bodies.are_paper_disks and self.scenario:
            return draw_scene(self.scenario, self.seed).bodies
        return bodies


def played_episodes(bag: Bag) -> tuple[PlayedEpisode, ...]:
    """Return the episodes of a bag that had a goal, named as the bag says."""
    episodes = read_episodes(bag, bag.custom_data.get(NAMESPACE_KEY))
    with_goal = [episode for episode in episodes if episode.goal is not None]
    names = bag.custom_data.get(EPISODES_KEY, "").split()
    played = []
    for number, episode in enumerate(with_goal):
        scenario, _, seed = names[number].rpartition(":") if number < len(names) else ("", "", "0")
        played.append(PlayedEpisode(scenario, int(seed), episode))
    return tuple(played)


def write_summary(path: Path, bag: Bag, summaries: Sequence[EpisodeSummary]) -> None:
    """Write the summary as JSON, whole or not at all."""
    content = {
        "recording": dict(bag.custom_data),
        "messages": bag.message_count,
        "duration": bag.duration,
        "successes": sum(summary["success"] for summary in summaries),
        "episodes": list(summaries),
    }
    write_json(path, content)


def summary_table(summaries: Sequence[EpisodeSummary]) -> FittingTable:
    """Return the summary as a table for people; errors are of the target, mean over pushes."""
    names = "Episode", "Pushes", "Distance", "Planning", "Model error", "Physics error", "Goal"
    table = FittingTable(names, left=("Episode", "Goal"))
    for summary in summaries:
        goal = "reached" if summary["success"] else "not reached"
        if summary["goals"] > 1:
            goal = f"{summary['goals_in_a_row']} of {summary['goals']} reached in a row"
        table.add_row(
            f"{summary['scenario']} {summary['seed']}",
            str(summary["pushes"]),
            _scaled(summary["final_distance"], "mm", 1),
            _scaled(summary["planning_time"], "ms", 0),
            _scaled(summary["model_error"], "mm", 1),
            _scaled(summary["physics_error"], "mm", 1),
            Text(goal, "green" if summary["success"] else "red"),
        )
    return table


def _mean(values: list[float] | list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _scaled(value: float | None, unit: str, digits: int) -> str:
    return "-" if value is None else f"{1e3 * value:.{digits}f} {unit}"


def write_results(folder: Path, video: bool, display: Display) -> bool:
    """Write everything that is made from the recording in ``folder/bag``.

    Returns:
        Whether every episode reached its goal.

    Raises:
        DatasetError: the recording is damaged.
        OutputError: something cannot be written.
    """
    with display.stage("reading the recording", "recording checked"):
        bag = Bag(folder / "bag")
        bag.check()
        played = played_episodes(bag)
        summaries = tuple(episode.summary() for episode in played)
        write_summary(folder / "summary.json", bag, summaries)
    with display.stage("writing the report", "report written"):
        write_page(folder / "report.html", read_content(bag).data)
    if video and played:
        with display.stage("rendering the moving picture", "moving picture rendered"):
            film = make_film(bag, choose_episode(played))
            write_whole(folder / "closed_loop.gif", encode_gif(film))
    display.console.print()
    display.console.print(summary_table(summaries), soft_wrap=True)
    display.console.print("\nWritten, to be opened in this order:")
    for path in written_files(folder):
        display.console.print(f"  {path}", markup=False, highlight=False, soft_wrap=True)
    return bool(summaries) and all(summary["success"] for summary in summaries)


def written_files(folder: Path) -> list[Path]:
    """Return what a run has written, the report page first, the bag and the logs last."""
    order = {".html": 0, ".gif": 1}
    return sorted(
        folder.glob("[!.]*"), key=lambda path: (path.is_dir(), order.get(path.suffix, 2), path)
    )


def choose_episode(played: Sequence[PlayedEpisode]) -> PlayedEpisode:
    """Return the episode that is nicest to watch: a success, long but not too long."""

    def rank(one: PlayedEpisode) -> tuple[bool, int]:
        pushes = len(one.episode.executed)
        return one.episode.success, pushes if pushes <= LIVELY else -pushes

    return max(played, key=rank)


def make_film(bag: Bag, one: PlayedEpisode) -> list[Image.Image]:
    """Render one episode, towards its last goal, from its recording."""
    from sain_sim.camera.renderer import Renderer  # takes a second to load

    one = one.last_part()
    radii = tuple(one.episode.start[:, RADIUS].tolist())
    robot = read_robot(bag.custom_data.get(ROBOT_KEY, DEFAULT_ROBOT))
    renderer = Renderer(robot, one.bodies, radii, CAMERA)
    moments = choose_moments(episode_moments(bag, one.episode))
    return render(renderer, one.bodies, moments, partial(describe_distance, one.title))
