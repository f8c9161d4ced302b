"""``ros2 run sain_bags info``: what a bag holds, and whether it is undamaged."""

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from sain_bags.reading.reader import Bag
from sain_bags.reading.timing import TopicTiming, read_timings
from sain_bags.transitions.episodes import Episode, namespaces, read_episodes
from sain_bags.writing.gaps import read_gaps
from sain_core.errors import SainError


@dataclass(frozen=True)
class InfoOptions:
    """Show what a bag holds: topics, rates, gaps, episodes and pushes."""

    bag: tyro.conf.Positional[Path]
    """A bag's folder, or its MCAP file."""
    check: bool = True
    """Read all of it first and compare every CRC; without, gaps are not counted and large bags are
    fast."""


def topic_table(bag: Bag, timings: Mapping[str, TopicTiming]) -> Table:
    """Return the bag's topics as a table, with the timings that are known."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("Topic", no_wrap=True)
    table.add_column("Type", style="dim", no_wrap=True)
    for name in ("Messages", "Rate", "Longest gap", "Missing"):
        table.add_column(name, justify="right")
    recorded = read_gaps(bag.custom_data) or {}
    for topic in bag.topics:
        mean = topic.messages / bag.duration if topic.messages > 1 and bag.duration else 0.0
        timing = timings.get(topic.name, TopicTiming(mean, 0.0, None))
        table.add_row(
            topic.name,
            topic.type,
            f"{topic.messages:,}",
            f"{timing.rate:.1f} Hz" if timing.rate else "-",
            f"{timing.longest_gap:.2f} s" if timing.longest_gap else "-",
            _missing(timing.missing, recorded.get(topic.name)),
        )
    return table


def episode_table(episodes: tuple[Episode, ...]) -> Table:
    """Return episodes as a table."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in ("Episode", "Disks", "Pushes", "Refused", "Distance", "Tolerance", "Planning"):
        table.add_column(name, justify="right")
    table.add_column("Goal")
    for episode in episodes:
        times = [plan.planning_time for plan in episode.plans]
        reached = "[green]reached[/]" if episode.success else "[red]not reached[/]"
        table.add_row(
            str(episode.episode_id),
            str(len(episode.start)),
            str(len(episode.executed)),
            str(len(episode.pushes) - len(episode.executed)),
            _millimetres(episode.final_distance),
            _millimetres(episode.tolerance),
            f"{1e3 * float(np.median(times)):.0f} ms" if times else "-",
            "none" if episode.goal is None else reached,
        )
    return table


def show(path: Path, console: Console, check: bool = True) -> None:
    """Print what a bag holds, after comparing every CRC in it where that is asked for.

    Raises:
        DatasetError: it is not a whole, undamaged bag.
    """
    bag = Bag(path)
    timings = read_timings(bag) if check else {}
    size = bag.size / 1e6
    files = f" in {len(bag.files)} files" if len(bag.files) > 1 else ""
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(bag.start * 1e-9))
    state = "every CRC is right" if check else "only its summary was checked"
    console.print(f"[bold]{path}[/]  {state}", highlight=False)
    console.print(
        f"{bag.message_count:,} messages in {bag.duration:.1f} s from {began}, {size:.2f} MB{files}"
        + "".join(f"\n{key}: {value}" for key, value in bag.custom_data.items()),
        highlight=False,
        markup=False,
    )
    console.print()
    console.print(topic_table(bag, timings))
    for namespace in namespaces(bag):
        episodes = read_episodes(bag, namespace)
        pushes = sum(len(episode.executed) for episode in episodes)
        reached = sum(episode.success for episode in episodes)
        console.print(
            f"\n[bold]{namespace or '/'}[/]  {len(episodes)} episodes, {pushes} pushes,"
            f" goal reached in {reached}",
            highlight=False,
        )
        console.print(episode_table(episodes))


def _missing(counted: int | None, recorded: str | None) -> str:
    """What the bag shows is certain; of several publishers only their recorder could tell."""
    if counted is not None:
        return f"{counted:,}"
    return recorded or "-"


def _millimetres(metres: float) -> str:
    return "-" if np.isnan(metres) else f"{1e3 * metres:.1f} mm"


def main() -> None:
    """Run from the command line."""
    options = tyro.cli(InfoOptions, prog="ros2 run sain_bags info")
    try:
        show(options.bag, Console(), options.check)
    except SainError as error:
        console = Console(stderr=True, soft_wrap=True)
        console.print(f"info: {error}", style="red", markup=False, highlight=False)
        sys.exit(1)


if __name__ == "__main__":
    main()
