"""A bag in the live page: one command serves it, and a reader goes through it in Chromium."""

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.remote.webelement import WebElement

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from sain_core.cli.command_line import executable
from sain_core.scene import POSITION
from tests.sain_bags.browser import WEBGL, Browser, opened_browser
from tests.sain_live.straw import free_port
from tests.sain_live.viewer import Viewer

pytestmark = pytest.mark.system


def start(*arguments: str) -> "subprocess.Popen[str]":
    command = [str(executable("sain_bags", "view")), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@contextmanager
def viewed(bag: Path, *arguments: str) -> Iterator[int]:
    """Run the command; yield the port that it says, and end it by Ctrl-C."""
    process = start(str(bag), "--port", str(port := free_port()), *arguments)
    said = ""
    while f"the page is at http://127.0.0.1:{port}" not in said:
        said = process.stdout.readline()
        assert said, process.wait()
    try:
        yield port
    finally:
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=30)[0]
    assert process.returncode in (0, 130) and "Traceback" not in rest


class Reader:
    """A person at the page."""

    def __init__(self, browser: Browser, port: int) -> None:
        self.browser = browser
        browser.open(f"http://127.0.0.1:{port}")
        self.wait(lambda: "distance left" in self.text and len(self.sliders) >= 2, "the page")

    @property
    def text(self) -> str:
        return str(self.browser.run("return document.body.innerText"))

    @property
    def sliders(self) -> list[WebElement]:
        return self.browser.all("[role=slider]")

    def fact(self, name: str) -> str:
        """Return what stands beside a name."""
        found = re.search(rf"^{name}\n(.+)$", self.text, re.MULTILINE)
        return found[1] if found else ""

    def press(self, label: str) -> None:
        (button,) = [one for one in self.browser.all("button") if one.text == label]
        button.click()

    def drag(self, slider: int, pixels: int) -> None:
        chain = ActionChains(self.browser.chrome, duration=50)
        chain.click_and_hold(self.sliders[slider]).move_by_offset(pixels, 0).release().perform()

    def wait(self, done: Callable[[], object], what: str) -> None:
        end = time.monotonic() + 60.0
        while not done():
            assert time.monotonic() < end, f"waited for {what}; the page says {self.text}"
            time.sleep(0.05)


PUSH = 1  # the second slider


def test_a_reader_goes_through_a_recording(ros_domain, episode_bag):
    first, second = read_content(Bag(episode_bag)).data["episodes"]
    done = [push for push in first["pushes"] if push["outcome"] == "executed"]
    slow = ("--rate", "0.01")
    with viewed(episode_bag, *slow) as port, opened_browser(WEBGL) as browser:
        viewer, reader = Viewer(port), Reader(browser, port)
        reader.wait(lambda: "Pause" in reader.text, "the player")
        for absent in ("Start", "Reset", "Next seed", "Load", "scenario", "Planner"):
            assert absent not in reader.text.split("\n")

        reader.drag(PUSH, 150)
        reader.wait(lambda: reader.fact("pushes") == f"{len(done)} of {len(done)}", "the last push")
        assert "Play" in reader.text.split("\n")  # it stands still
        assert reader.fact("distance left") == f"{1e3 * done[-1]['distance'][1]:.1f} mm"
        last = read_episodes(Bag(episode_bag))[0].executed[-1]
        place = pytest.approx(tuple(last.after[1, POSITION]), abs=1e-5)
        viewer.wait(lambda: viewer.nodes["/bodies/1"]["position"][:2] == place, "the target")
        goal = viewer.nodes["/goals/1"]["position"][:2]
        assert goal == pytest.approx((first["poses"][0]["x"], first["poses"][0]["y"]), abs=1e-5)

        reader.press("◀ push")
        reader.wait(lambda: reader.fact("pushes") == f"1 of {len(done)}", "the push before")
        assert reader.fact("distance left") == f"{1e3 * done[0]['distance'][1]:.1f} mm"
        reader.press("push ▶")
        reader.press("push ▶")
        reader.wait(lambda: second["title"] in reader.text.split("\n")[0:40], "the next episode")
        reader.press("Play")
        reader.wait(lambda: "Pause" in reader.text.split("\n"), "that it plays")
        viewer.close()


def test_what_is_no_recording_ends_it_in_words(ros_domain, tmp_path):
    process = start(str(tmp_path / "missing"))
    said = process.communicate(timeout=60)[0]
    assert process.returncode == 1 and "missing" in said and "Traceback" not in said
