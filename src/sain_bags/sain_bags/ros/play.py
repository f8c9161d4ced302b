"""``ros2 run sain_bags play``: publishes a bag's messages again, byte by byte, in their time."""

import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event as Flag
from types import FrameType
from typing import Final

import rclpy
import tyro
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from sain_bags.playing import CLOCK, Event, Passage, PassageConfig, Played, choose_topics, play
from sain_bags.reading.reader import Bag
from sain_bags.ros.player import Player
from sain_core.command_line import describe_options
from sain_core.errors import SainError

LOOK: Final = 0.02  # [s], between two looks for subscribers
SHOWN: Final = 0.2  # [s], between two looks at the bar


@dataclass(frozen=True)
class PlayOptions:
    """Play a bag: publish its messages again as they were recorded, in their time.

    Ctrl-C ends it. Topics are renamed with --ros-args -r /from:=/to.
    """

    bag: tyro.conf.Positional[Path]
    """A bag's folder, or its MCAP file."""
    topics: tuple[str, ...] = ()
    """Topics to play, with their full names; none: all but /parameter_events."""
    namespace: str = ""
    """Put before every topic's name, /clock aside."""
    wait: float = 1.0
    """Wait at most so long until every topic has a subscriber [s]."""
    passage: PassageConfig = field(default_factory=PassageConfig)


class PlaybackClock:
    """Monotonic time, and an end that a signal asks for."""

    def __init__(self) -> None:
        """Take over SIGINT and SIGTERM."""
        self._end = Flag()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def now(self) -> float:
        """Return the time [s]."""
        return time.monotonic()

    def wait(self, seconds: float) -> bool:
        """Wait so long, or until a signal; tell whether one came."""
        return self._end.wait(seconds) if seconds > 0.0 else self._end.is_set()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._end.set()


def run(options: PlayOptions, console: Console) -> Played:
    """Play a bag to its end or until a signal comes.

    Raises:
        DatasetError: the bag is damaged, or there is nothing in it that can be played.
    """
    watch, bag = PlaybackClock(), Bag(options.bag)
    chosen = choose_topics(bag, options.topics, options.passage.clock > 0.0)
    player = Player(chosen, options.namespace)
    try:
        passage = Passage(bag, player.topics, options.passage, player.latched)
        if options.passage.clock and CLOCK not in player.topics:
            player.offer_clock()
        await_subscribers(player, options.wait, watch)
        played = _play_with_bar(passage, player, watch, options, console)
        player.let_arrive()
    finally:
        player.destroy_node()
    return played


def await_subscribers(player: Player, patience: float, watch: PlaybackClock) -> None:
    """Wait until every topic has a subscriber, not longer than patience allows [s]."""
    end = watch.now() + patience
    while player.unheard() and watch.now() < end and not watch.wait(LOOK):
        pass


def _play_with_bar(
    passage: Passage, player: Player, watch: PlaybackClock, options: PlayOptions, console: Console
) -> Played:
    columns = (
        TextColumn("play"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s, {task.fields[count]:,} messages"),
    )
    with Progress(*columns, console=console, transient=True, refresh_per_second=5) as bar:
        task = bar.add_task("play", total=passage.duration, count=0)
        shown, messages = 0.0, 0

        def publish(event: Event) -> None:
            nonlocal shown, messages
            player.publish(event)
            messages += event.raw is not None
            if (now := watch.now()) > shown + SHOWN:
                shown = now
                bar.update(task, completed=_place(event, passage), count=messages)

        return play(passage.events(), publish, watch)


def _place(event: Event, passage: Passage) -> float:
    """Return how far into the passage an event is [s], in whichever time through it."""
    return event.due % passage.duration if event.due > passage.duration > 0.0 else event.due


def main() -> None:
    """Run from the command line."""
    describe_options(PassageConfig)
    console = Console(soft_wrap=True)
    try:
        options = tyro.cli(
            PlayOptions,
            prog="ros2 run sain_bags play",
            args=remove_ros_args(sys.argv)[1:],
            config=(tyro.conf.OmitArgPrefixes,),
        )
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        played = run(options, console)
    except SainError as error:
        Console(stderr=True, soft_wrap=True).print(
            f"play: {error}", style="red", highlight=False, markup=False
        )
        sys.exit(1)
    finally:
        rclpy.try_shutdown()
    late = f", at most {1e3 * played.late:.1f} ms late" if played.messages else ""
    state = "Stopped after" if played.stopped else "Played"
    console.print(f"{state} {played.messages:,} messages{late}", highlight=False)


if __name__ == "__main__":
    main()
