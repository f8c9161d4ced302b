"""The page in a real browser: what is drawn is what was recorded, and nothing else runs."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.writing import write_page
from tests.sain_bags.browser import Browser, opened_browser
from tests.sain_bags.shown import Show, recorded, shown_scenes

WIDTHS, SCHEMES = (400, 1400), ("light", "dark")
EVIL = "</script><img src=x onerror=\"window.hacked='{}'\"><script>window.hacked=1</script>"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


@pytest.fixture
def page(bag: Path) -> Path:
    return page_of(bag)


def page_of(bag: Path) -> Path:
    return write_page(bag.parent / "report.html", read_content(Bag(bag)).data)


def drawn(scene) -> np.ndarray:
    return np.array([[disk.x, disk.y, disk.theta] for disk in scene.disks])


def close(one, other) -> bool:
    """Equal to half a tenth of a millimetre, and angles to a thousandth."""
    gap = np.abs(np.asarray(one) - other)
    return bool((gap[:, :2] < 5e-5).all() and (gap[:, 2] < 1e-3).all())


def slide_to(browser: Browser, key: str) -> None:
    browser.one("#slider").send_keys(key)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_it_opens_without_complaint_or_request_and_fits(browser, page, width, scheme):
    browser.open(page, width, scheme)
    for button in browser.all("#list button"):
        button.click()
        slide_to(browser, Keys.END)
    assert browser.text("h1") == page.parent.name
    assert browser.run("return document.documentElement.scrollWidth") <= width
    assert browser.complaints() == [] and browser.requests() == []


def test_the_slider_shows_the_recorded_scenes(browser, bag, page):
    browser.open(page)
    scenes = shown_scenes(bag, 1)
    slide_to(browser, Keys.HOME)
    for place, scene in enumerate(scenes):
        assert close(browser.disks(), drawn(scene)), f"scene {place}"
        seconds = scene.header.stamp.sec + 1e-9 * scene.header.stamp.nanosec
        first = scenes[0].header.stamp.sec + 1e-9 * scenes[0].header.stamp.nanosec
        assert browser.text("#moment").startswith(f"{seconds - first:.2f}")
        slide_to(browser, Keys.ARROW_RIGHT)
    assert int(browser.one("#slider").get_attribute("value")) == len(scenes) - 1
    assert "push 2 of 2" in browser.one("#slider").get_attribute("aria-valuetext")


def test_a_push_is_shown_with_what_was_expected(browser, bag, page):
    browser.open(page)
    found = recorded(bag)
    browser.all("#marks button")[1].click()
    result = found["push_result"][1]
    assert close(browser.disks(), drawn(result.after))
    expected = found["plan"][1].predicted.reshape(2, 2, 8)[0]
    physics = drawn(found["push_result"][1].prediction)
    for kind, poses in (("expected", expected), ("physics", physics)):
        ghosts = f"#view circle.ghost.{kind}"
        assert browser.numbers(ghosts, "cx") == pytest.approx(1000 * poses[:, 0], abs=0.05)
        assert browser.numbers(ghosts, "cy") == pytest.approx(-1000 * poses[:, 1], abs=0.05)
    (box,) = [one for one in browser.all("#legend label") if one.text == "predicted by the planner"]
    box.click()
    assert not browser.all("#view .ghost.expected") and browser.all("#view .ghost.physics")
    facts = browser.text("#push")
    assert "Push 2 of 2" in facts and "Error of sain" in facts and "bullet_nominal" in facts


def test_it_plays_to_the_end_and_stops(browser, page):
    """On a busy machine it may be at its end before the next question to the browser."""
    browser.open(page)
    browser.run(
        """window.labels = [];
        const button = document.getElementById("play");
        new MutationObserver(() => window.labels.push(button.getAttribute("aria-label")))
          .observe(button, {attributeFilter: ["aria-label"]});"""
    )
    browser.one("#speed").send_keys("10")
    browser.one("#play").send_keys(Keys.SPACE)
    labels = "return window.labels"
    WebDriverWait(browser.chrome, 30).until(lambda _: browser.run(labels) == ["Pause", "Play"])
    slider = browser.one("#slider")
    assert slider.get_attribute("value") == slider.get_attribute("max")


def test_what_is_missing_is_told(browser, record, messages, tmp_path):
    recording = record()
    kind = "std_msgs/msg/Bool"
    data = bytes(messages.store.serialize_cdr(messages.make(kind), kind))
    recording.writer.add_topic(messages.topic("/tick", kind))
    for place, sequence in enumerate((3, 4, 9, 10, 12)):
        recording.writer.write("/tick", data, recording.now + place * 10**9, sequence=sequence)
    recording.writer.close()
    browser.open(page_of(tmp_path / "bag"))
    cells = [cell.text for cell in browser.all("#topics tbody td")]
    assert cells[0].startswith("/tick") and cells[1] == "5"
    assert cells[-2:] == ["5", "–"]  # lost; late
    browser.one("#gaps summary").click()
    assert browser.text("#gaps li") == "/tick 4 before 2.00\u202fs, 1 before 4.00\u202fs"
    assert len(browser.all("#topics .missing")) == 2
    assert "Messages missing\n5\n" in browser.text("#tiles")
    assert not browser.one("#episodes").is_displayed()
    assert browser.complaints() == []


def test_strangers_text_stays_text(browser, record, tmp_path):
    evil = [EVIL.format(place) for place in range(4)]
    recording = record("b<img src=x onerror=window.hacked=1>", custom_data={evil[0]: evil[1]})
    show = Show(recording)
    show.source, show.error = evil[2], evil[3]
    show.episode(1, 2, [0.05, 0.03], refused=1)
    topic = recording.messages.topic(f"/x{evil[0]}", "std_msgs/msg/Bool")
    recording.writer.add_topic(topic)
    recording.writer.close()
    browser.open(page_of(recording.writer.folder), 400)
    browser.all("#pushes button")[1].click()
    assert browser.run("return window.hacked") is None
    assert not browser.all("img") and len(browser.all("script")) == 2
    assert browser.text("#custom dt:nth-of-type(2)") == evil[0]
    assert browser.text("#custom dd:nth-of-type(2)") == evil[1]
    assert evil[2] in browser.text("#push") and evil[3] in browser.text("#push")
    assert any(evil[0] in cell.text for cell in browser.all("#topics .topic"))
    assert browser.run("return document.documentElement.scrollWidth") <= 400
    assert browser.complaints() == [] and browser.requests() == []


def test_a_script_put_into_the_page_does_not_run(browser, page):
    """Were text to become markup one day, the page's policy would still not let it run."""
    browser.open(page)
    browser.run("document.body.insertAdjacentHTML('beforeend', arguments[0])", EVIL.format(1))
    browser.run("const s = document.createElement('script'); s.textContent = 'window.hacked = 2';"
                "document.body.append(s)")  # fmt: skip
    assert browser.run("return window.hacked") is None
    assert any("Content Security Policy" in line for line in browser.complaints())
