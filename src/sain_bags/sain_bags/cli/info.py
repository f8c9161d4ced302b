"""``ros2 run sain_bags info``: what a bag holds, and whether it is undamaged."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from sain_bags.reading.reader import BAG_HELP, Bag
from sain_bags.reading.timing import TopicTiming, read_timings
from sain_bags.rows.episodes import Episode, read_episodes
from sain_bags.rows.results import OUTLINES_KEY
from sain_bags.rows.topics import left_out, namespaces
from sain_bags.writing.gaps import SILENT_KEY, UNRECORDED_KEY, read_gaps, read_names
from sain_core.cli.terminal import FittingTable
from sain_core.config import Config, option, required

LISTED: Final = (SILENT_KEY, UNRECORDED_KEY, OUTLINES_KEY)  # custom data not shown as it is


@dataclass(frozen=True)
class InfoOptions(Config):
    """Show the contents of a bag: topics, rates, gaps, episodes and pushes."""

    bag: tyro.conf.Positional[Path] = required(BAG_HELP)
    check: bool = option(
        True,
        "read all messages and compare the CRCs that they have; without it no gaps are shown",
    )


def warnings_about(bag: Bag) -> Iterator[str]:
    """Yield what a reader should see of a bag before its contents."""
    if silent := read_names(bag.custom_data, SILENT_KEY):
        yield f"No message came on {', '.join(silent)}"
    if unrecorded := read_names(bag.custom_data, UNRECORDED_KEY):
        yield f"Not recorded: {', '.join(unrecorded)}"
    undefined = {found.topic for found in bag.channels if not found.has_definition}
    if undefined:
        yield f"Without a definition of their messages: {', '.join(sorted(undefined))}"
    yield from left_out(bag)
    if bag.message_count:
        yield "Missing messages are counted from the first of each topic"


def topic_table(bag: Bag, timings: Mapping[tuple[str, str], TopicTiming]) -> FittingTable:
    """Return the bag's topics as a table, with the timings that are known."""
    names = "Topic", "Type", "Messages", "Rate", "Longest gap", "Missing", "Latest"
    table = FittingTable(names, left=("Topic", "Type"))
    recorded = read_gaps(bag.custom_data) or {}
    for topic in bag.topics:
        mean = topic.messages / bag.duration if topic.messages > 1 and bag.duration else 0.0
        timing = timings.get((topic.name, topic.type), TopicTiming())
        rate = timing.rate if timings else mean
        table.add_row(
            topic.name,
            Text(topic.type, "dim"),
            f"{topic.messages:,}",
            f"{rate:.1f} Hz" if rate else "-",
            f"{timing.longest_gap:.2f} s" if timing.longest_gap else "-",
            _missing(timing.missing if timing.messages else None, recorded.get(topic.name)),
            f"{1e3 * timing.latest:.1f} ms" if timing.latest else "-",
        )
    return table


def episode_table(episodes: tuple[Episode, ...]) -> FittingTable:
    """Return episodes as a table, with a row for each goal."""
    names = "Episode", "Disks", "Pushes", "Refused", "Distance", "Tolerance", "Planning", "Goal"
    table = FittingTable(names, left=("Goal",))
    for number, episode in (one for whole in episodes for one in whole.numbered):
        times = [plan.planning_time for plan in episode.plans]
        table.add_row(
            str(episode.episode_id),
            str(len(episode.start)),
            str(len(episode.executed)),
            str(len(episode.pushes) - len(episode.executed)),
            _millimetres(episode.distance(episode.final)),
            _millimetres(episode.goal.tolerance) if episode.goal else "-",
            f"{1e3 * float(np.median(times)):.0f} ms" if times else "-",
            _outcome(number, episode),
        )
    return table


def _outcome(number: int, episode: Episode) -> Text:
    """Return whether a goal, the so many-th of its episode, was reached."""
    if episode.goal is None:
        return Text("none")
    before = f"goal {number}: " if number > 1 else ""
    found = ("reached", "green") if episode.success else ("not reached", "red")
    return Text.assemble(before, found)


def run(options: InfoOptions, console: Console) -> None:
    """Print what a bag holds; see `show`."""
    show(options.bag, console, options.check)


def show(path: Path, console: Console, check: bool = True) -> None:
    """Print what a bag holds, after comparing every CRC in it where that is asked for."""
    bag = Bag(path)
    if check:
        bag.check()
    timings = read_timings(bag) if check else {}
    size = bag.size / 1e6
    files = f" in {len(bag.files)} files" if len(bag.files) > 1 else ""
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(bag.start * 1e-9))
    about = {key: value for key, value in bag.custom_data.items() if key not in LISTED}
    state = "every CRC is right" if check else "only its summary was checked"
    state = state if bag.has_crcs else "it has no CRCs: damage inside messages is not detected"
    console.print(f"[bold]{path}[/]  {state}", highlight=False)
    console.print(
        f"{bag.message_count:,} messages in {bag.duration:.1f} s from {began}, {size:.2f} MB{files}"
        + "".join(f"\n{key}: {value}" for key, value in about.items()),
        highlight=False,
        markup=False,
    )
    for line in warnings_about(bag):
        console.print(f"[yellow]{escape(line)}[/]", highlight=False, soft_wrap=True)
    console.print()
    console.print(topic_table(bag, timings), soft_wrap=True)
    for namespace in namespaces(bag):
        episodes = read_episodes(bag, namespace)
        pushes = sum(len(episode.executed) for episode in episodes)
        towards = [part for one in episodes for part in one.by_goal if part.goal is not None]
        reached = sum(part.success for part in towards)
        console.print(
            f"\n[bold]{namespace or '/'}[/]  {len(episodes)} episodes, {pushes} pushes,"
            f" {reached} of {len(towards)} goals reached",
            highlight=False,
        )
        console.print(episode_table(episodes), soft_wrap=True)


def _missing(counted: int | None, recorded: str | None) -> str:
    """What the bag shows is certain; of several publishers only their recorder could tell."""
    if counted is not None:
        return f"{counted:,}"
    return recorded or "-"


def _millimetres(metres: float) -> str:
    return "-" if np.isnan(metres) else f"{1e3 * metres:.1f} mm"
