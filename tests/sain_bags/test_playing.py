"""When a bag's messages are due, by a clock of the test's own; no ROS, and nobody waits."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sain_bags.bag.metadata import TopicQos
from sain_bags.playing import (
    Event,
    Passage,
    PlayOptions,
    choose_topics,
    place_in,
    play,
)
from sain_bags.reading.reader import Bag
from sain_core.errors import ConfigError, DatasetError
from tests.sain_bags.conftest import SECOND, START

LATCHED = TopicQos(durability="transient_local", depth=1)


class Hand:
    """A clock that goes on only when it is waited for, or when publishing takes its time."""

    def __init__(self, takes: float = 0.0, end: float = float("inf")) -> None:
        self.time, self.takes, self.end = 100.0, takes, 100.0 + end
        self.published: list[tuple[float, Event]] = []

    def now(self) -> float:
        return self.time

    def wait(self, seconds: float) -> bool:
        assert seconds >= 0.0
        self.time = min(self.time + seconds, max(self.end, self.time))
        return self.time >= self.end

    def publish(self, event: Event) -> None:
        self.published.append((self.time - 100.0, event))
        self.time += self.takes


@pytest.fixture
def flags(record: Callable[..., object], messages, tmp_path: Path) -> Path:
    """Ten flags, one each 100 ms; a latched word at the first and the fourth; parameter events."""
    recording = record()
    kind = "std_msgs/msg/Bool"
    data = bytes(messages.store.serialize_cdr(messages.make(kind), kind))
    for name, qos in (("/flag", TopicQos()), ("/word", LATCHED), ("/parameter_events", LATCHED)):
        recording.writer.add_topic(messages.topic(name, kind, offered_qos=(qos,)))
    for place in range(10):
        time = START + place * SECOND // 10
        recording.writer.write("/flag", data, time, sequence=place + 1)
        if place in (0, 3):
            recording.writer.write("/word", data, time + 1, sequence=place + 1)
    recording.writer.close()
    return tmp_path / "bag"


def passage(folder: Path, latched: dict[str, int] | None = None, **config) -> Passage:
    return Passage(Bag(folder), {"/flag", "/word"}, PlayOptions(Path(), **config), latched)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.1, 10.0), st.floats(0.0, 0.9), st.floats(0.0, 1.0), st.sampled_from([0, 10, 37]))
def test_all_of_a_part_is_due_when_it_came_by_the_rate(flags, rate, start, duration, clock):
    """Messages, and the time between them at its own rate; again and again in a loop."""
    config = {"rate": rate, "start": start, "duration": duration, "clock": clock}
    chosen, hand = passage(flags, **config), Hand()
    events = list(chosen.events())
    play(iter(events), hand.publish, hand)
    assert [time for time, _ in hand.published] == pytest.approx([e.due for e in events])
    first, last = START + round(1e9 * start), START + round(1e9 * 0.9)
    last = min(last, first + round(1e9 * duration)) if duration else last
    messages = list(Bag(flags).raw_messages({"/flag", "/word"}, first))
    assert [e.raw for e in events if e.raw] == [raw for raw in messages if raw.log_time <= last]
    for event in events:
        assert event.due == pytest.approx(1e-9 * (event.time - first) / rate, abs=1e-9)
    ticks = [event.time for event in events if event.raw is None]
    step = 1e9 * rate / clock if clock else 0.0
    assert ticks == [first + round(n * step) for n in range(len(ticks))]
    assert bool(clock) == bool(ticks) and (not clock or last - ticks[-1] < step)
    assert [event.due for event in events] == sorted(event.due for event in events)
    assert chosen.duration == pytest.approx(1e-9 * (last - first) / rate)
    looped = list(islice(passage(flags, loop=True, **config).events(), 3 * len(events)))
    turn = chosen.duration or 1.0 / rate  # of a part without a duration
    for number, event in enumerate(looped):
        turns, place = divmod(number, len(events))
        assert event.due == pytest.approx(turns * turn + events[place].due, abs=1e-6)


def test_what_was_latched_before_the_start_comes_first(flags):
    events = list(passage(flags, {"/word": 1}, start=0.5).events())
    assert (events[0].due, events[0].raw.topic, events[0].raw.sequence) == (0.0, "/word", 4)
    assert [(e.due, e.raw.sequence) for e in events][1] == (0.0, 6)
    assert len([e for e in events if e.raw.topic == "/word"]) == 1
    assert len(list(passage(flags, {"/word": 5}, start=0.5).events())) == 7
    assert len(list(passage(flags, {"/word": 5}).events())) == 12  # none is played twice


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_what_a_split_repeats_is_played_once(record, messages, tmp_path, start):
    recording, kind = record(), "std_msgs/msg/Bool"
    data = bytes(messages.store.serialize_cdr(messages.make(kind), kind))
    recording.writer.add_topic(messages.topic("/word", kind, offered_qos=(LATCHED,)))
    for place in range(4):  # the second and third word are the same, said once
        published = START + (1 if place == 2 else place)
        recording.writer.write("/word", data, START + place * SECOND, published, published % 7)
    recording.writer.close()
    config = PlayOptions(Path(), start=start)
    word = Passage(Bag(tmp_path / "bag"), {"/word"}, config, {"/word": 1})
    expected = [0.0, 1.0, 3.0] if not start else [0.0, 0.5, 2.5]
    assert [event.due for event in word.events()] == pytest.approx(expected)


def test_what_is_overdue_comes_at_once_and_in_order():
    hand = Hand(takes=0.25)
    played = play((Event(0.1 * place, place, None) for place in range(5)), hand.publish, hand)
    assert [event.time for _, event in hand.published] == list(range(5))
    assert [time for time, _ in hand.published] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    assert played.late == pytest.approx(0.6)


def test_topics_are_chosen(flags):
    bag = Bag(flags)
    assert [topic.name for topic in choose_topics(bag, ())] == ["/flag", "/word"]
    assert [t.name for t in choose_topics(bag, ("/parameter_events",))] == ["/parameter_events"]
    with pytest.raises(DatasetError, match=r"has no topic /other; it has /flag, /param.*, /word"):
        choose_topics(bag, ("/other",))


def test_a_recorded_clock_is_not_doubled(flags):
    chosen = Passage(Bag(flags), {"/flag", "/clock"}, PlayOptions(Path(), clock=100.0))
    assert all(event.raw is not None for event in chosen.events())


@pytest.mark.parametrize(
    ("config", "message"),
    [({"rate": 0.0}, "rate is 0.0"), ({"start": -1.0}, "start is -1.0"),
     ({"rate": float("nan")}, "must be finite")],
)  # fmt: skip
def test_settings_are_checked(config, message):
    with pytest.raises(ConfigError, match=message):
        PlayOptions(Path(), **config)


@pytest.mark.parametrize(
    ("namespace", "topic", "name"),
    [
        ("", "/sain/scene", "/sain/scene"),
        ("/again", "/sain/scene", "/again/sain/scene"),
        ("a/b/", "/x", "/a/b/x"),
        ("again", "/clock", "/clock"),
    ],
)
def test_topics_have_a_place_in_a_namespace(namespace, topic, name):
    assert place_in(namespace, topic) == name
