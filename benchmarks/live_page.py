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
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Thread

import numpy as np
import rclpy
import tyro
from rich.console import Console

from benchmarks.live_browser import seconds_to_picture
from benchmarks.live_driver import PATIENCE, SCENARIO, Driver
from benchmarks.live_viewer import Viewer
from sain_bringup.graph import PAGE, graph_commands, page_command, ros_arguments
from sain_bringup.graph_options import LiveOptions
from sain_bringup.processes import Supervisor
from sain_core.cli.terminal import FittingTable
from sain_core.ros.node_main import ros_context

HANDLE = "/goals/0"
LAST_LINK = "/arm" + "".join(f"/panda_link{link}" for link in range(1, 8))
WATCH = 0.1  # [s]
NEAR = (0.05, 0.25)  # [m], from the body to the goal that is dragged away


@dataclass(frozen=True)
class Options:
    """How it is measured."""

    port: int = 8931
    """Of the page."""
    drags: int = 30
    """Goals that are dragged."""
    rounds: int = 4
    """Of the same episodes, without a page and with three viewers; 0: no slowdown."""
    episodes: int = 3
    """In each."""
    pictures: int = 3
    """How often the page is started in Chromium, too."""
    seed: int = 0
    """Of the first one."""


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
        up, end = Event(), Event()

        def watch() -> None:  # all the time: what nobody hears counts as hung
            while not end.wait(WATCH):
                supervisor.check()
                if not supervisor.starting(names):
                    up.set()

        watching = Thread(target=watch, daemon=True)
        watching.start()
        driver = Driver()
        driver.ready = lambda: driver.wait(up.is_set, "the graph")
        yield driver
        end.set()
        watching.join()
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


def dragged(driver: Driver, shown: Viewer, count: int, seed: int) -> np.ndarray:
    """Return times (count, 2) [s] from the end of a drag to the push, and without the search."""
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
        taken, push = driver.pushes[before] - begun, driver.ids[before]
        driver.wait(lambda p=push: p in driver.searches, "its plan")
        times.append((taken, taken - driver.searches[push]))
        shown.turn("loop", "Pause")
        driver.wait(lambda e=ended: len(driver.results) > e, "its result")
        time.sleep(0.5)  # for the page to see the settled scene
        driver.scene = None
    return np.array(times)


def rates(driver: Driver, viewers: list[Viewer], seed: int) -> list[float]:
    """Return scenes per second while the arm moves, and then the updates of each viewer."""
    for times in (driver.pushes, driver.results, driver.scenes):
        times.clear()
    for one in viewers:
        one.frames.clear()
    driver.play(seed)
    spans = list(zip(driver.pushes, driver.results, strict=False))
    length = sum(end - start for start, end in spans)
    frames = [np.array(times) for times in (driver.scenes, *(one.frames for one in viewers))]
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
    if options.pictures:
        pictures = [seconds_to_picture(live) for _ in range(options.pictures)]
        what = f"start to first picture in Chromium, median of {len(pictures)}"
        table.add_row(what, f"{np.median(pictures):.1f} s", "8 s")
    begun = time.monotonic()
    with graph(live, with_page=True) as driver, viewer(live.port) as first:
        first.wait(lambda: LAST_LINK in first.nodes, "the arm", PATIENCE)
        seconds = time.monotonic() - begun
        table.add_row("start to the scene in a viewer", f"{seconds:.1f} s", "8 s")
        driver.ready()
        times = 1e3 * dragged(driver, first, options.drags, options.seed)
        for name, column, most in (("", 0, "300 ms"), (", without the search", 1, "")):
            p50, p95 = np.percentile(times[:, column], (50, 95))
            table.add_row(f"drag to push, median of {len(times)}{name}", f"{p50:.0f} ms", "")
            table.add_row(f"drag to push, p95{name}", f"{p95:.0f} ms", most)
        scenes, rate = rates(driver, [first], options.seed)
        table.add_row("scenes that the simulator publishes", f"{scenes:.1f}/s", "")
        table.add_row("updates of one viewer", f"{rate:.1f}/s", "30/s")
        with viewer(live.port) as second, viewer(live.port) as third:
            least = min(rates(driver, [first, second, third], options.seed)[1:])
            table.add_row("updates of each of three viewers, least", f"{least:.1f}/s", "30/s")
    paces = (("real time", 1.0), ("as fast as possible", 0.0)) if options.rounds else ()
    for name, pace in paces:
        alone, watched = slowdown(options, replace(live, real_time_factor=pace))
        share = 100.0 * (watched / alone - 1.0)
        what = f"slowdown of the loop with three viewers, {name}"
        table.add_row(what, f"{share:+.1f} % ({alone:.1f} to {watched:.1f} s)", "10 %")
    Console().print(table, soft_wrap=True)


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
    rclpy.try_shutdown()
