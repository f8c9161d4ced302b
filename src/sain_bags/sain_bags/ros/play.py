"""``ros2 run sain_bags play``: publishes a bag's messages again, byte by byte, in their time."""

from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.progress import BarColumn, TextColumn

from sain_bags.playing import CLOCK, Event, Passage, Played, PlayOptions, choose_topics, play
from sain_bags.reading.reader import Bag
from sain_bags.ros.stop_signal import StopSignal
from sain_core.cli.terminal import transient_bar
from sain_core.guarding.lifetime import release

if TYPE_CHECKING:
    from sain_bags.ros.player import Player

LOOK: Final = 0.02  # [s], between two looks for subscribers
SHOWN: Final = 0.2  # [s], between two looks at the bar


def run(options: PlayOptions, console: Console) -> None:
    """Play a bag to its end or until a signal comes, and print what was played.

    Raises:
        DatasetError: the bag is damaged, or there is nothing in it that can be played.
    """
    from sain_core.ros.node_main import ros_context

    with ros_context():
        played = play_bag(options, console)
    late = f", at most {1e3 * played.late:.1f} ms late" if played.messages else ""
    state = "Stopped after" if played.stopped else "Played"
    console.print(f"{state} {played.messages:,} messages{late}", highlight=False)


def play_bag(options: PlayOptions, console: Console) -> Played:
    """Play a bag until it ends or a signal comes; rclpy is initialised. Raises as `run`."""
    from sain_bags.ros.player import Player

    watch, bag = StopSignal(), Bag(options.bag)
    chosen = choose_topics(bag, options.topics, options.clock > 0.0)
    player = Player(chosen, options.namespace)
    try:
        passage = Passage(bag, player.topics, options, player.latched)
        if options.clock and CLOCK not in player.topics:
            player.offer_clock()
        await_subscribers(player, options.wait, watch)
        played = _play_with_bar(passage, player, watch, options, console)
        player.let_arrive()
    finally:
        release(player)
    return played


def await_subscribers(player: "Player", patience: float, watch: StopSignal) -> None:
    """Wait until every topic has a subscriber, not longer than patience allows [s]."""
    end = watch.now() + patience
    while player.unheard() and watch.now() < end and not watch.wait(LOOK):
        pass


def _play_with_bar(
    passage: Passage, player: "Player", watch: StopSignal, options: PlayOptions, console: Console
) -> Played:
    columns = (
        TextColumn("play"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:.1f} s, {task.fields[count]:,} messages"),
    )
    with transient_bar(console, *columns, refresh_per_second=5) as bar:
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
