"""The live page in a browser: the whole graph, as `make live` starts it."""

import re
import signal
import subprocess
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from sain_bringup.graph import executable
from sain_core.scene import RADIUS
from sain_core.shapes.library import get_shape
from sain_live.page.scene import HANDLE
from sain_live.page.serving import CAMERA, FIELD_OF_VIEW, LOOK_AT
from sain_live.requests import Reset
from tests.sain_bags.browser import WEBGL, Browser, opened_browser
from tests.sain_live.straw import free_port

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

PATIENCE = 180.0  # [s]: each picture is drawn on the processor
GRIP = 1 / 7 + 0.225 / 2  # of the handle's length: the middle of its square
BY = (-70, 25)  # pixels
DRAGS = 4
SIZE = {"width": 1366, "height": 768, "deviceScaleFactor": 1, "mobile": False}


@pytest.fixture
def address(ros_domain, tmp_path):
    """A graph in a domain of its own; the address that it prints."""
    port = free_port()
    options = ["--port", str(port), "--no-record", "--model", "planar", "--real-time-factor", "0"]
    command = [str(executable("sain_live", "live")), "--scenario", "push_t", *options]
    said = tmp_path / "said.txt"
    with said.open("w") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream, cwd=tmp_path)
    try:
        found = wait(lambda: re.search(r"the page is at (\S+)", said.read_text()), "the address")
        assert found[1] == f"http://127.0.0.1:{port}"
        yield found[1]
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)
    assert process.returncode in (0, 130), said.read_text()


def wait(found: Callable[[], Any], what: str, browser: Browser | None = None) -> Any:
    """Return what is found once it is there."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            if result := found():
                return result
        except WebDriverException:
            pass  # the page is being drawn anew
        seen = "" if browser is None else f"; the page says {browser.text('body')!r}"
        assert time.monotonic() < end, f"waited {PATIENCE} s for {what}{seen}"
        time.sleep(0.2)


def on_screen(browser: Browser, place: np.ndarray) -> tuple[int, int]:
    """Return where the camera that a page begins with sees a place of the world."""
    box = browser.run("const r = document.querySelector('canvas').getBoundingClientRect();"
                      "return [r.left, r.top, r.width, r.height]")  # fmt: skip
    left, top, width, height = box
    camera = np.array(CAMERA)
    ahead = np.array(LOOK_AT) - camera
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    above, way = np.cross(right, ahead), place - camera
    scale = height / 2 / np.tan(FIELD_OF_VIEW / 2) / (way @ ahead)
    x, y = left + width / 2 + scale * (way @ right), top + height / 2 - scale * (way @ above)
    return round(x), round(y)


def drag(browser: Browser, start: tuple[int, int], by: tuple[int, int]) -> None:
    """Drag with the mouse, slowly enough for a page that draws few pictures a second."""
    begun = time.monotonic()
    browser.settle()  # for two pictures
    slow = max(1.0, time.monotonic() - begun)
    actions = ActionChains(browser.chrome, duration=150)
    pointer = actions.w3c_actions.pointer_action
    pointer.move_to_location(*start)
    pointer.pause(1.5 * slow)
    pointer.pointer_down()
    pointer.pause(slow)
    for share in (0.25, 0.5, 0.75, 1.0):
        pointer.move_to_location(*(round(s + share * b) for s, b in zip(start, by, strict=True)))
        pointer.pause(0.7 * slow)
    pointer.pointer_up()
    actions.perform()


def drag_until(browser: Browser, start: tuple[int, int], words: str) -> None:
    """Drag until the page says these words: a slow page may miss where a drag began."""
    for _ in range(DRAGS):
        drag(browser, start, BY)
        end = time.monotonic() + PATIENCE / 5
        while time.monotonic() < end:
            if words in browser.text("body"):
                return
            time.sleep(0.2)
    pytest.fail(f"dragged {DRAGS} times; the page says {browser.text('body')!r}")


def click(browser: Browser, text: str) -> None:
    def clicked() -> bool:
        path = f"//*[normalize-space(text())='{text}']"
        shown = [one for one in browser.chrome.find_elements(By.XPATH, path) if one.is_displayed()]
        if shown:
            shown[0].click()
        return bool(shown)

    wait(clicked, f"{text} to click on", browser)


def planner_setting(graph: Any, name: str) -> int:
    reply = graph.call(
        GetParameters, "mppi_node/get_parameters", GetParameters.Request(names=[name])
    )
    return int(reply.values[0].integer_value)


def test_a_goal_is_dragged_a_slider_moved_and_a_body_arrives(address, graph):
    case = Reset.draw("push_t", 0).case
    pose = case.goal.poses[0]
    with opened_browser(WEBGL) as browser:
        browser.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SIZE)
        browser.chrome.get(address)
        wait(lambda: "push_t, seed 0" in browser.text("body"), "the scenario", browser)
        wait(lambda: "paused" in browser.text("body"), "the loop to be paused", browser)

        radius = get_shape("t").circumradius * case.disks[0, RADIUS]
        grip = GRIP * (HANDLE + radius) * np.ones(2)
        cos, sin = np.cos(pose.heading), np.sin(pose.heading)
        x, y = np.array([pose.x, pose.y]) + np.array([[cos, -sin], [sin, cos]]) @ grip
        time.sleep(3.0)  # for the first pictures
        handle = on_screen(browser, np.array([x, y, 0.002]))
        drag_until(browser, handle, "Start follows it")

        before = planner_setting(graph, "planner.horizon")
        click(browser, "Planner")
        slider = wait(
            lambda: next(
                (
                    one
                    for one in browser.all("[role=slider]")
                    if one.is_displayed() and one.get_attribute("aria-valuemax") == "50"
                ),
                None,
            ),
            "the slider of the horizon",
            browser,
        )
        slider.send_keys(Keys.ARROW_LEFT)
        wait(lambda: planner_setting(graph, "planner.horizon") == before - 1, "the setting")

        click(browser, "Run")
        click(browser, "Start")
        wait(lambda: "goal reached" in browser.text("body"), "the body to arrive", browser)
        assert "reached with" in browser.text("body")
        complaints = [one for one in browser.complaints() if "SEVERE" in one]
    graph.wait(lambda: graph.heard["scene"], "a scene")
    body = graph.heard["scene"][-1].disks[0]
    moved = np.hypot(body.x - pose.x, body.y - pose.y)
    assert moved > 0.03, "the body went to where the goal was before it was dragged"
    assert complaints == []
