"""The page as a person sees it, in Chromium."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sain_core.scene import RADIUS
from sain_live.page.controls import description
from sain_live.page.live_page import LivePage
from sain_live.page.scene import HANDLE
from sain_live.page.serving import CAMERA, FIELD_OF_VIEW, LOOK_AT
from sain_live.requests import SetGoal
from sain_live.settings import planner_settings
from sain_live.state import Level
from tests.sain_bags.browser import WEBGL, Browser, opened_browser
from tests.sain_live.straw import AIM, BODIES, SCENE, Requests, made_up, served

WIDTH, HEIGHT = 390, 844  # pixels of a phone
SQUARE = 1.7 / 7  # of a handle's size: where the middle of its square is, along both axes
PLACES = """const place = one => one.getBoundingClientRect().toJSON();
const scene = document.querySelector("canvas[data-engine]");
const button = [...document.querySelectorAll("button")].find(one => one.innerText == "Start");
return scene && button && [place(scene), place(button)]"""

TOO_WIDE = """const found = [...document.querySelectorAll("*")].filter(one =>
  one.getBoundingClientRect().right > innerWidth + 1 || one.scrollLeft > 0 ||
  (one.scrollWidth > one.clientWidth + 1 && one.className.includes?.("ScrollArea")));
return [document.documentElement.scrollWidth, found.map(one => one.outerHTML.slice(0, 99))]"""
TABS = """return [...document.querySelectorAll("[role=tab]")].map(one => one.innerText.trim())"""
OPEN = """const named = [...document.querySelectorAll("[role=tab]")].filter(
  one => one.innerText.trim() == arguments[0]);
named.forEach(one => one.click()); return named.length"""
UNFOLD = """const folded = [...document.querySelectorAll("*")].filter(one =>
  !one.children.length && one.innerText?.startsWith("Charts ·"));
folded.forEach(one => one.click()); return folded.length"""


@pytest.fixture(scope="module")
def browser():
    with opened_browser(WEBGL) as browser:
        yield browser


@pytest.fixture
def page():
    state, requests = made_up(), Requests()
    with served(state, requests.append) as page:
        yield state, requests, page


def opened(browser: Browser, page: LivePage, width: int, height: int, phone: bool) -> None:
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone}
    browser.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    touch = {"enabled": phone, "maxTouchPoints": 1}
    browser.chrome.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", touch)
    browser.chrome.get(f"http://127.0.0.1:{page.server.get_port()}")


def wait(look: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + 60.0
    while not (seen := look()):
        assert time.monotonic() < end, f"waited for {what}"
        time.sleep(0.1)
    return seen


def pixel(place: np.ndarray, scene: dict[str, float]) -> tuple[float, float]:
    """Return where the camera sees a place [m]."""
    forward = np.subtract(LOOK_AT, CAMERA)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    x, y, depth = np.array([right, np.cross(right, forward), forward]) @ (place - CAMERA)
    focal = scene["height"] / 2 / np.tan(FIELD_OF_VIEW / 2)
    middle = scene["x"] + scene["width"] / 2, scene["y"] + scene["height"] / 2
    return middle[0] + focal * x / depth, middle[1] - focal * y / depth


def test_on_a_phone_the_panel_is_below_the_scene_and_goals_can_be_dragged(browser, page):
    state, requests, page = page
    opened(browser, page, WIDTH, HEIGHT, phone=True)

    def places() -> Any:
        """The scene and a button of the panel, once one is above the other on the screen."""
        scene, button = browser.run(PLACES) or ({"bottom": HEIGHT}, {"top": 0.0, "bottom": 0.0})
        below = scene["bottom"] <= button["top"] and button["bottom"] <= HEIGHT
        return (scene, button) if below else None

    scene, _ = wait(places, "the page")
    assert scene["width"] == WIDTH
    assert scene["height"] > 0.4 * HEIGHT
    for row in SCENE:
        x, y = pixel(np.array([row[0], row[1], 0.0]), scene)
        assert scene["left"] < x < scene["right"]
        assert scene["top"] < y < scene["bottom"]
    pose = AIM.poses[0]
    size = HANDLE + BODIES.shapes[0].circumradius * SCENE[0, RADIUS]
    aslant = pose.heading + np.pi / 4
    along = SQUARE * size * 2**0.5 * np.array([np.cos(aslant), np.sin(aslant), 0.0])
    held = np.array([pose.x, pose.y, 0.0]) + along
    wait(lambda: page.viewers == 1, "the viewer")

    def drag() -> list[Any]:
        way = [np.add(held, (0.0, -0.1 * part, 0.0)) for part in np.linspace(0.0, 1.0, 6)]
        for kind, place in [("touchStart", way[0]), *(("touchMove", one) for one in way[1:])]:
            x, y = pixel(place, scene)
            touch(kind, [{"x": round(x), "y": round(y)}])
            browser.settle()
        touch("touchEnd", [])
        browser.settle()
        return requests.of(SetGoal)

    def touch(kind: str, points: list[Any]) -> None:
        event = {"type": kind, "touchPoints": points}
        browser.chrome.execute_cdp_cmd("Input.dispatchTouchEvent", event)

    wait(drag, "the goal to be dragged")  # once it is drawn
    aim = requests.of(SetGoal)[0].goal
    assert (aim.poses[0].x, aim.poses[0].y) == pytest.approx((pose.x, pose.y - 0.1), abs=0.02)
    assert state.aim is requests.of(SetGoal)[-1].goal


def test_on_a_phone_no_tab_is_wider_than_the_screen(browser, page):
    state, _, page = page
    state.update(model="runs/" + 40 * "long" + "/sain.safetensors", why=80 * "why")
    state.update(picture=np.zeros((480, 640, 3), np.uint8))
    state.tell(Level.REFUSAL, 100 * "word")
    opened(browser, page, WIDTH, HEIGHT, phone=True)
    wait(lambda: browser.run(UNFOLD), "the charts' bar")
    names = ("Run", "Planner", "Charts", "Learning", "Camera")
    wait(lambda: set(names) <= set(browser.run(TABS)), "all tabs")
    for name in names:
        assert browser.run(OPEN, name) == 1
        browser.settle()
        time.sleep(0.5)  # charts find their width a moment later
        assert browser.run(TOO_WIDE) == [WIDTH, []], name


def test_each_setting_has_its_description_in_the_text(browser, page):
    opened(browser, page[2], WIDTH, HEIGHT, phone=True)
    wait(lambda: browser.run(OPEN, "Planner"), "the tab")
    text = "return document.body.textContent"
    wait(lambda: "overshoot to where the arm" in browser.run(text), "the settings")
    written = browser.run(text)
    assert [one.name for one in planner_settings() if description(one.item) not in written] == []
    seen = browser.run("return document.body.innerText")
    assert "K, sequences rolled out in the first round" in seen
