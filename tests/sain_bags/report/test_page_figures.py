"""The figures that a person reads in the page, beside the same ones computed from the bag alone."""

import re
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.writing import write_page
from tests.sain_bags.browser import Browser, opened_browser
from tests.sain_bags.conftest import resting_scene
from tests.sain_bags.expected_page import UNKNOWN, assert_shows, expected_episodes, expected_topics
from tests.sain_bags.shown import Show, recorded

Record = Callable[..., object]
NONSENSE = re.compile(r"NaN|undefined|null|Infinity|∞|\[object")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


def page_of(bag: Path) -> Path:
    return write_page(bag.parent / f"{bag.name}.html", read_content(Bag(bag)).data)


def with_pushes(record: Record) -> None:
    show = Show(record())
    show.episode(1, 2, [0.05, 0.03, 0.004])
    show.episode(2, 3, [0.02])


def with_refusals(record: Record) -> None:
    show = Show(record())
    show.episode(1, 3, [0.02, 0.04], refused=1)
    show.episode(2, 2, [0.05], refused=0)


def without_results(record: Record) -> None:
    Show(record(), results=False).episode(1, 2, [0.05, 0.03])


def without_scenes(record: Record) -> None:
    Show(record(), scenes=False).episode(1, 2, [0.05, 0.03])


def without_pushes(record: Record) -> None:
    Show(record()).episode(1, 2, [])


def without_goal(record: Record) -> None:
    recording = record()
    for number in range(3):
        recording.scene(1, number, resting_scene(0.5))


def only_topics(record: Record) -> None:
    record().add("/flag", "std_msgs/msg/Bool", data=True)


def empty(record: Record) -> None:
    record()


def with_invalid_numbers(record: Record) -> None:
    recording = record()
    scene = resting_scene(0.5)
    scene[0, 7], scene[1, :2] = -0.08, 1e6
    poses = recording.messages.poses(0.5, tolerance=-1.0)
    recording.add("/sain/goal", "Goal", goal_id=1, episode_id=1, poses=poses)
    recording.scene(1, 1, scene)
    good = resting_scene(0.5)
    recording.push(1, 1, good, resting_scene(0.6), location=1e9)
    recording.push(2, 1, good, good, error_code=9, location=np.nan)


BAGS = (
    with_pushes, with_refusals, without_results, without_scenes, without_pushes, without_goal,
    only_topics, empty, with_invalid_numbers,
)  # fmt: skip


@pytest.fixture
def bag(request: pytest.FixtureRequest, record: Record, tmp_path: Path) -> Path:
    recordings = []

    def start(**options: object) -> object:
        recordings.append(record(**options))
        return recordings[-1]

    request.param(start)
    recordings[0].writer.close()
    return tmp_path / "bag"


def cells(browser: Browser, selector: str) -> list[list[str]]:
    script = """return [...document.querySelectorAll(arguments[0])].map(
      (row) => [...row.cells].map((cell) => cell.innerText.trim()));"""
    return browser.run(script, selector)


def pairs(browser: Browser, selector: str) -> dict[str, str]:
    """Return the terms of a list of descriptions with their descriptions."""
    script = """return [...document.querySelectorAll(arguments[0] + " dt")].map(
      (term) => [term.innerText, term.nextElementSibling.innerText]);"""
    return dict(browser.run(script, selector))


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("bag", [with_pushes, with_refusals], indirect=True)
def test_every_row_has_the_numbers_of_the_bag(browser, bag, width):
    browser.open(page_of(bag), width)
    episodes, table = expected_episodes(bag), browser.one("#pushes")
    assert len(browser.all("#list button")) == len(episodes)
    for button, episode in zip(browser.all("#list button"), episodes.values(), strict=True):
        button.send_keys(Keys.ENTER)
        script = "return [...arguments[0].rows[0].cells].map((cell) => cell.textContent)"
        names = browser.run(script, table)
        shown = cells(browser, "#pushes tbody tr")
        assert [row[0] for row in shown] == [str(place + 1) for place in range(len(episode.rows))]
        for place, (row, expected) in enumerate(zip(shown, episode.rows, strict=True)):
            figures = dict(zip(names[1:], row[1:], strict=True))
            for name, value in expected.items():
                assert_shows(figures[name], value, f"{name} of push {place + 1}")
            browser.all("#marks button")[place].send_keys(Keys.ENTER)
            facts = pairs(browser, "#push")
            for name in ("Tool at", "Direction", "Travel", "Target moved", "Planning time"):
                assert_shows(facts[name], expected[name], f"{name} of push {place + 1}")
            if expected["Physics error"] is not None:
                assert_shows(facts["Error of bullet_nominal"], expected["Physics error"])
                assert_shows(facts["Error of sain"], expected["Planner error"])
            *_, end = facts["Target to goal"].split(" → ")
            assert_shows(end, expected["Target to goal"])


@pytest.mark.parametrize("bag", [with_pushes, with_refusals], indirect=True)
def test_the_head_and_the_list_count_what_happened(browser, bag):
    browser.open(page_of(bag), 1280)
    episodes, found = expected_episodes(bag), recorded(bag)
    tiles = {name: text.split("\n") for name, text in pairs(browser, "#tiles").items()}
    reached = sum(episode.distance <= 0.02 for episode in episodes.values())
    assert tiles["Goals reached"] == [f"{reached} of {len(episodes)}", f"{len(episodes)} episodes"]
    executed = sum(episode.executed for episode in episodes.values())
    refused = sum(episode.refused for episode in episodes.values())
    assert tiles["Pushes"] == [str(executed), f"{refused} refused"]
    rows = list(chain.from_iterable(episode.rows for episode in episodes.values()))
    for tile, column in (
        ("Error of physics", "Physics error"),
        ("Error of the planner", "Planner error"),
    ):
        assert_shows(
            tiles[tile][0], float(np.median([r[column] for r in rows if r[column] is not None]))
        )
    times = [plan.planning_time for plan in found["plan"]]
    assert_shows(tiles["Planning time"][0], float(np.median(times)))
    assert_shows(tiles["Planning time"][1].split(": ")[1], float(np.percentile(times, 95)))
    for button, episode in zip(browser.all("#list button"), episodes.values(), strict=True):
        title, count, distance = button.text.split("\n")
        assert title.startswith("Episode ")
        assert count == f"{episode.executed} push{'es' * (episode.executed != 1)}"
        assert_shows(
            UNKNOWN if distance == "no goal" else distance.split(", ")[1], episode.distance
        )
        button.send_keys(Keys.ENTER)
        assert f": {count}" in browser.text("#episode-title")
        assert (f"{episode.refused} refused" in browser.text("#episode-title")) == bool(
            episode.refused
        )


@pytest.mark.parametrize("bag", [with_pushes, only_topics], indirect=True)
def test_the_topics_have_their_counts_rates_and_gaps(browser, bag):
    browser.open(page_of(bag), 1280)
    expected = expected_topics(bag)
    rows = cells(browser, "#topics tbody tr")
    assert len(rows) == len(expected)
    for name, messages, rate, _, gap, missing in rows:
        topic = expected[name.split("\n")[0]]
        assert int(messages) == topic.messages and missing == "–"  # these have no sequence numbers
        assert_shows(rate, topic.rate, f"rate of {name}")
        assert_shows(gap.split("\n")[0], topic.gap, f"gap of {name}")
    facts = browser.text("#facts")
    total = sum(topic.messages for topic in expected.values())
    assert f" · {total:,} message{'s' * (total != 1)} · {len(expected)} topic" in facts


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("bag", BAGS, indirect=True)
def test_no_page_shows_a_number_that_is_none(browser, bag, width):
    browser.open(page_of(bag), width)

    def look() -> None:
        everything = browser.run(
            "return document.body.innerText + document.querySelector('main').outerHTML"
        )
        assert not NONSENSE.search(everything), NONSENSE.search(everything)

    look()
    for button in browser.all("#list button"):
        button.send_keys(Keys.ENTER)
        look()
        for place in range(len(browser.all("#marks button"))):
            browser.all("#marks button")[place].send_keys(Keys.ENTER)
            look()
        if browser.one("#slider").is_enabled():
            browser.one("#slider").send_keys(Keys.END)
            look()
    assert browser.run("return document.documentElement.scrollWidth") <= width
    assert browser.complaints() == []
