"""The page as a person sees it, in Chromium."""

import time
from base64 import b64decode
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from PIL import Image

from sain_core.goal import Goal
from sain_core.scene import DISK_HEIGHT, RADIUS, make_scene
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_live.page.live_page import LivePage
from sain_live.page.scene import HANDLE
from sain_live.page.serving import CAMERA, FIELD_OF_VIEW, LOOK_AT
from sain_live.state import LiveArm, LiveScene, LiveState
from sain_sim.arm.panda import describe_arm
from tests.sain_bags.browser import WEBGL, Browser, opened_browser
from tests.sain_live.straw import AIM, BODIES, SCENE, Written, made_up, served

WIDTH, HEIGHT = 390, 844  # pixels of a phone
SQUARE = 1.7 / 7  # of a handle's size: where the middle of its square is, along both axes
DISKS = np.array([(0.60, -0.05), (0.45, 0.05)])
SEEN = {
    "pusher": (0.60, -0.08, DISK_HEIGHT),
    "target": (0.45, 0.02, DISK_HEIGHT),
    "table": (0.60, 0.25, 0.0),
}
JOINTS = [f"panda_joint{number}" for number in range(1, 8)]
RAISED = (0.0, -0.8, 0.0, -2.2, 0.0, 1.5, 0.8)  # [rad]
PLACES = """const place = one => one.getBoundingClientRect().toJSON();
const scene = document.querySelector("canvas[data-engine]");
const button = [...document.querySelectorAll("button")].find(one => one.innerText == "Start");
return scene && button && [place(scene), place(button)]"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser(WEBGL) as browser:
        yield browser


@pytest.fixture
def page() -> Iterator[tuple[LiveState, Written, LivePage]]:
    known, orders = made_up(), Written()
    with served(known, orders) as page:
        yield known, orders, page


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
    known, orders, page = page
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
        return orders.of("aim")

    def touch(kind: str, points: list[Any]) -> None:
        event = {"type": kind, "touchPoints": points}
        browser.chrome.execute_cdp_cmd("Input.dispatchTouchEvent", event)

    wait(drag, "the goal to be dragged")  # once it is drawn
    ((aim,), *_) = orders.of("aim")
    assert (aim.poses[0].x, aim.poses[0].y) == pytest.approx((pose.x, pose.y - 0.1), abs=0.02)
    assert known.aim is orders.of("aim")[-1][0]


def test_the_bodies_lie_in_the_middle_of_a_table_before_a_soft_sky(browser, page):
    known, _, page = page
    known.update(
        scene=LiveScene(make_scene(DISKS, np.ones(2), np.array([0.08, 0.06])), 1, 1),
        bodies=PAPER_DISKS,
        aim=None,
    )
    known.update(
        bodies=Bodies.disks(2),
        aim=Goal.place(0.42, 0.25),
        arm=LiveArm(describe_arm(0.012, 0.22)),
        joints=dict(zip(JOINTS, RAISED, strict=True)),
    )
    opened(browser, page, 1280, 800, phone=False)
    scene, _ = wait(lambda: browser.run(PLACES), "the page")

    def seen() -> dict[str, tuple[int, int, int]]:
        """Return the colours that a person sees of both disks, of the table and of the sky."""
        shot = browser.chrome.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
        picture = Image.open(BytesIO(b64decode(shot["data"]))).convert("RGB")
        at = {name: pixel(np.array(place), scene) for name, place in SEEN.items()}
        at["sky"] = scene["right"] - 20.0, scene["top"] + 60.0
        return {name: picture.getpixel((round(x), round(y))) for name, (x, y) in at.items()}

    def as_they_are() -> bool:
        found = seen()
        blue, orange = found["pusher"], found["target"]
        table, sky = found["table"], found["sky"]
        return (
            blue[2] > blue[0] + 60
            and orange[0] > orange[2] + 60
            and table[0] > table[2] + 5
            and sky[2] > sky[0] + 5
        )

    wait(as_they_are, "blue and orange disks on a warm table before a blue sky")
    for x, y, _ in SEEN.values():
        across, down = pixel(np.array((x, y, 0.0)), scene)
        assert 0.1 < (across - scene["left"]) / scene["width"] < 0.9
        assert 0.3 < (down - scene["top"]) / scene["height"] < 0.8
