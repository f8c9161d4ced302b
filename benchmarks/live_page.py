"""The live page: how soon it is there, how fast it answers and how much it slows the loop.

    ./env python -m benchmarks.live_page

The graph is the one of ``ros2 run sain_bringup live``, without a recorder. Viewers are websocket
clients in this process, which take what a browser takes and draw nothing. The slowdown compares
the same episodes, in turn without a page and with three viewers: the pushes are equal.
"""

import math
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import tyro
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rich.console import Console

from benchmarks.live_browser import seconds_to_picture
from benchmarks.live_viewer import Viewer
from sain_bringup.graph import PAGE, graph_commands, page_command, ros_arguments
from sain_bringup.options import LiveOptions
from sain_bringup.processes import Supervisor
from sain_core.cli.fitting_table import FittingTable
from sain_core.errors import ErrorCode
from sain_core.ros.codec import encode_disks
from sain_core.ros.node_main import NAMESPACE, ros_context
from sain_core.ros.qos import QUEUE, RELIABLE
from sain_interfaces.action import Reach
from sain_interfaces.msg import Push, PushResult, Scene
from sain_interfaces.srv import ResetScene
from sain_live.aims import Aim
from sain_live.orders import Reset
from sain_live.ros.asking import goal_message

SCENARIO = "push_t"
HANDLE = "/goals/0"
LAST_LINK = "/arm" + "".join(f"/panda_link{link}" for link in range(1, 8))
NEAR = (0.05, 0.25)  # [m], from the body to the goal that is dragged away
PATIENCE = 120.0  # [s]


@dataclass(frozen=True)
class Options:
    """How it is measured."""

    port: int = 8931
    """Of the page."""
    drags: int = 30
    """Goals that are dragged."""
    rounds: int = 4
    """Of the same episodes, without a page and with three viewers."""
    episodes: int = 3
    """In each."""
    browser: bool = True
    """Whether to start the page in Chromium, too."""
    seed: int = 0
    """Of the first one."""


class Driver(Node):
    """Plays episodes without a page, and hears pushes, results and scenes."""

    def __init__(self) -> None:
        """Join the graph."""
        super().__init__("driver", namespace=NAMESPACE)
        self.pushes: list[float] = []
        self.results: list[float] = []
        self.scene: Scene | None = None
        self.create_subscription(Push, "push", lambda _: self._note(self.pushes), QUEUE)
        self.create_subscription(PushResult, "push_result", self._on_result, QUEUE)
        self.create_subscription(Scene, "scene", self._on_scene, RELIABLE)
        self._reset = self.create_client(ResetScene, "reset_scene")
        self._reach = ActionClient(self, Reach, "reach")
        self.ready: Callable[[], None] = lambda: None  # waits until all of the graph is
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def wait(self, done: Any, what: str) -> None:
        """Let time pass until something is so."""
        end = time.monotonic() + PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.01)
            assert time.monotonic() < end, f"waited {PATIENCE} s for {what}"

    def play(self, seed: int) -> float:
        """Play an episode; return the wall time [s] from its goal to its end."""
        case = Reset(SCENARIO, seed).case()
        self.wait(lambda: self._reset.service_is_ready() and self._reach.server_is_ready(), "graph")
        request = ResetScene.Request(seed=seed, disks=encode_disks(case.disks))
        request.shapes, request.roles = list(case.shapes), list(map(str, case.roles))
        request.friction = case.friction
        asked = self._reset.call_async(request)
        self.wait(asked.done, "reset")
        assert asked.result().error_code == ErrorCode.OK, asked.result().error_message
        begun = time.monotonic()
        goal = goal_message(Aim(case.goal), 0, 30, self.get_clock().now().to_msg())
        sent = self._reach.send_goal_async(Reach.Goal(goal=goal))
        self.wait(sent.done, "planner")
        ended = sent.result().get_result_async()
        self.wait(ended.done, "end")
        return time.monotonic() - begun

    def _note(self, times: list[float]) -> None:
        times.append(time.monotonic())

    def _on_result(self, _: PushResult) -> None:
        self._note(self.results)

    def _on_scene(self, message: Scene) -> None:
        self.scene = message


@contextmanager
def graph(options: LiveOptions, with_page: bool) -> Iterator[Driver]:
    """Run the graph, and a driver in it."""
    with (
        tempfile.TemporaryDirectory() as folder,
        ros_context(),
        Supervisor(Path(folder, "logs")) as supervisor,
    ):
        commands = graph_commands(replace(options, record=False), ros_arguments(()), Path(folder))
        names = [name for name in commands if with_page or name != PAGE]
        for name in names:
            supervisor.start(name, commands[name])
        driver = Driver()
        driver.ready = lambda: driver.wait(lambda: not supervisor.starting(names), "the graph")
        yield driver
        driver.destroy_node()


@contextmanager
def page(options: LiveOptions, count: int) -> Iterator[list[Viewer]]:
    """Run a page beside a graph, with so many viewers."""
    command = page_command(replace(options), ros_arguments(()))
    command = [*command, "-p", "scenario:=''"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    with ExitStack() as stack:
        try:
            yield [stack.enter_context(viewer(options.port)) for _ in range(count)]
        finally:
            stack.close()
            process.send_signal(signal.SIGINT)
            process.wait()


@contextmanager
def viewer(port: int) -> Iterator[Viewer]:
    """Open the page, once it is there."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            opened = Viewer(port)
            break
        except OSError:
            assert time.monotonic() < end, "no page"
            time.sleep(0.05)
    opened.wait(lambda: HANDLE in opened.nodes, "the goal", PATIENCE)
    yield opened
    opened.close()


def dragged(driver: Driver, shown: Viewer, count: int, seed: int) -> list[float]:
    """Return the times [s] from the end of a drag to the push on the wire."""
    random, times = np.random.default_rng(seed), []
    for _ in range(count):
        driver.wait(lambda: driver.scene and driver.scene.settled, "a scene")
        assert driver.scene is not None
        body = driver.scene.disks[0]
        turn = (math.cos(body.theta / 2), 0.0, 0.0, math.sin(body.theta / 2))
        shown.nodes[HANDLE]["wxyz"] = turn  # so that the goal is reached at once
        shown.drag(HANDLE, (body.x, body.y))
        shown.turn("loop", "Start")
        shown.wait(lambda: "goal reached" in shown.texts, "an end", PATIENCE)
        time.sleep(0.3)
        x, y = next(
            (x, y)
            for x, y in random.uniform((0.42, -0.2), (0.6, 0.2), (1000, 2)).tolist()
            if NEAR[0] < math.hypot(x - body.x, y - body.y) < NEAR[1]
        )
        before, ended = len(driver.pushes), len(driver.results)
        begun = time.monotonic()
        shown.drag(HANDLE, (x, y))
        driver.wait(lambda b=before: len(driver.pushes) > b, "a push")
        times.append(driver.pushes[before] - begun)
        shown.turn("loop", "Pause")
        driver.wait(lambda e=ended: len(driver.results) > e, "its result")
        time.sleep(0.5)  # for the page to see the settled scene
        driver.scene = None
    return times


def rates(driver: Driver, viewers: list[Viewer], seed: int) -> list[float]:
    """Return the updates per second of each viewer, while the arm moves."""
    driver.pushes.clear()
    driver.results.clear()
    for one in viewers:
        one.frames.clear()
    driver.play(seed)
    spans = list(zip(driver.pushes, driver.results, strict=False))
    length = sum(end - start for start, end in spans)
    frames = [np.array(one.frames) for one in viewers]
    return [sum(((f > s) & (f < e)).sum() for s, e in spans) / length for f in frames]


def slowdown(options: Options, live: LiveOptions) -> tuple[float, float]:
    """Return the wall time [s] of the episodes without a page, and with three viewers."""
    seeds = range(options.seed, options.seed + options.episodes)
    alone, watched = [], []
    with graph(live, with_page=False) as driver:
        driver.ready()
        driver.play(options.seed)
        for _ in range(options.rounds):
            alone.append(sum(driver.play(seed) for seed in seeds))
            with page(live, 3):
                watched.append(sum(driver.play(seed) for seed in seeds))
    return float(np.median(alone)), float(np.median(watched))


def main(options: Options = Options()) -> None:
    """Measure and print a table."""
    live = LiveOptions(scenario=SCENARIO, seed=options.seed, port=options.port, record=False)
    table = FittingTable()
    table.add_column("figure")
    table.add_column("value", "right")
    table.add_column("goal", "right")
    if options.browser:
        picture = seconds_to_picture(live)
        table.add_row("start to first picture in Chromium", f"{picture:.1f} s", "8 s")
    begun = time.monotonic()
    with graph(live, with_page=True) as driver, viewer(live.port) as first:
        first.wait(lambda: LAST_LINK in first.nodes, "the arm", PATIENCE)
        seconds = time.monotonic() - begun
        table.add_row("start to the scene in a viewer", f"{seconds:.1f} s", "8 s")
        driver.ready()
        times = 1e3 * np.array(dragged(driver, first, options.drags, options.seed))
        p50, p95 = np.percentile(times, (50, 95))
        table.add_row(f"drag to push, median of {len(times)}", f"{p50:.0f} ms", "")
        table.add_row("drag to push, p95", f"{p95:.0f} ms", "300 ms")
        (rate,) = rates(driver, [first], options.seed)
        table.add_row("updates of one viewer", f"{rate:.1f}/s", "30/s")
        with viewer(live.port) as second, viewer(live.port) as third:
            least = min(rates(driver, [first, second, third], options.seed))
            table.add_row("updates of each of three viewers, least", f"{least:.1f}/s", "30/s")
    for name, pace in (("real time", 1.0), ("as fast as possible", 0.0)):
        alone, watched = slowdown(options, replace(live, real_time_factor=pace))
        share = 100.0 * (watched / alone - 1.0)
        what = f"slowdown of the loop with three viewers, {name}"
        table.add_row(what, f"{share:+.1f} % ({alone:.1f} to {watched:.1f} s)", "10 %")
    Console().print(table, soft_wrap=True)


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
    rclpy.try_shutdown()
