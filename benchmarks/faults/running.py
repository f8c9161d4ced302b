"""A graph that plays episodes one after the other, while something goes wrong with it."""

import io
import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from threading import Timer
from typing import Any, Final
from unittest.mock import patch

import domain_coordinator
import numpy as np
from rich.console import Console

from sain_bringup.children import RestartLimits
from sain_bringup.display import Display
from sain_bringup.graph import (
    LEARNER,
    MODEL,
    PLANNER,
    RECORDER,
    SIMULATOR,
    GraphOptions,
    graph_commands,
    restart_command,
    ros_arguments,
)
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.ros.director import Director
from sain_bringup.ros.progress import Progress
from sain_core.errors import ErrorCode, SainError
from sain_core.ros.node_main import ros_context
from sain_core.ros.qos import QUEUE
from sain_eval.scenes.scenarios import SCENARIOS
from sain_interfaces.msg import PushResult, Scene

ROOT: Final = Path(__file__).parents[2]
PARTS: Final = (SIMULATOR, MODEL, PLANNER, RECORDER)
TOLERANCE: Final = 0.02  # [m]
TIMEOUT: Final = 60.0  # [s]
NEVER: Final = RestartLimits(crashes=10**9)  # too many crashes: they are what is wanted here
SAME: Final = 1e-9  # [m] and [rad]: a heading that becomes a quaternion and back is rounded


@dataclass
class Observed:
    """What a bystander heard of pushes, and what is wrong with it."""

    results: list[tuple[float, PushResult]] = field(default_factory=list)  # and when [s]

    def on_result(self, message: PushResult) -> None:
        """Take note of a result; one that is the last one again is no other push."""
        last = self.results[-1][1] if self.results else None
        again = last is not None and (last.push_id, last.after.scene_id) == (
            message.push_id,
            message.after.scene_id,
        )
        if not again or message.error_code != ErrorCode.OK:
            self.results.append((time.monotonic(), message))

    @property
    def latest(self) -> float:
        """When the last push was heard of that was executed [s]; never: 0."""
        return max(
            (at for at, one in self.results[-9:] if one.error_code == ErrorCode.OK), default=0.0
        )

    @property
    def executed(self) -> list[PushResult]:
        """Results of pushes that were executed."""
        return [one for _, one in self.results if one.error_code == ErrorCode.OK]

    @property
    def twice(self) -> int:
        """Pushes that were executed more than once."""
        ids = [one.push_id for one in self.executed]
        return len(ids) - len(set(ids))

    @property
    def broken(self) -> int:
        """Pushes that did not begin where the push before had led."""
        pairs = zip(self.executed, self.executed[1:], strict=False)
        return sum(
            one.episode_id == other.episode_id
            and other.before.scene_id == one.after.scene_id
            and not np.allclose(places(one.after), places(other.before), rtol=0.0, atol=SAME)
            for one, other in pairs
        )


def strike(process: int, stopped: float = 0.0) -> None:
    """Kill a process, or stop it for so long [s]."""
    os.kill(process, signal.SIGSTOP if stopped else signal.SIGKILL)

    def go_on() -> None:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGCONT)

    if stopped:
        Timer(stopped, go_on).start()


def places(scene: Scene) -> list[tuple[float, float, float]]:
    """Return the poses in a scene; bodies that rest may have some speed left."""
    return [(disk.x, disk.y, disk.theta) for disk in scene.disks]


@dataclass
class Graph:
    """A graph that runs, and the node that plays on it."""

    supervisor: Supervisor
    director: Director
    observed: Observed
    interference: Callable[[], None] = lambda: None
    seed: int = 0

    def play(self) -> None:
        """Play the next episode; raises `SainError` where it does not come to its end."""
        scene = SCENARIOS["anywhere"].scene(self.seed)
        self.seed += 1
        progress = Progress(Display(Console(file=io.StringIO())), "")
        self.director.play(scene, TOLERANCE, progress)

    def process(self, name: str) -> int:
        """Return the number of a process."""
        return next(c.process.pid for c in self.supervisor.children if c.name == name)


@contextmanager
def own_domain() -> Iterator[None]:
    """Use a domain that nobody else uses: not even processes that were killed a moment ago.

    Its nodes can import policies of the tests.
    """
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    with (
        domain_coordinator.domain_id() as domain,
        patch.dict(os.environ, ROS_DOMAIN_ID=str(domain), PYTHONPATH=path),
    ):
        yield


@contextmanager
def graph(folder: Path, options: GraphOptions) -> Iterator[Graph]:
    """Run a graph with a recording, and end it."""
    made: list[Graph] = []

    def check() -> None:
        supervisor.check()
        for one in made:
            one.interference()

    with own_domain(), ros_context(), Supervisor(folder, UNHURRIED, NEVER) as supervisor:
        director = Director(check, TIMEOUT, supervisor)
        observed = Observed()
        director.create_subscription(PushResult, "push_result", observed.on_result, QUEUE)
        try:
            for name, command in graph_commands(options, ros_arguments(()), folder).items():
                again = restart_command(name, command)
                supervisor.start(name, command, patient=name == RECORDER, again=again)
            parts = (*PARTS, LEARNER)
            director.wait_for_graph(lambda: supervisor.starting(parts), lambda text: None)
            made.append(Graph(supervisor, director, observed))
            yield made[0]
        finally:
            made.clear()
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop()
            director.destroy_node()


class Strikes:
    """Strikes one process at random times, each time when the graph works again."""

    def __init__(self, running: Graph, strike: Callable[[int], None], name: str, seed: int) -> None:
        """Strike a process of a graph, by its number."""
        self._graph, self._strike, self._name = running, strike, name
        self._random = random.Random(seed)
        self._due = self._draw()
        self.times: list[float] = []  # [s]
        self.recoveries: list[float] = []  # [s], until a push was executed with all parts there
        self.spared: list[tuple[float, float]] = []  # from each strike until then [s]
        self.survived = 0  # strikes in episodes that came to their end

    def repeat(self, tries: int) -> None:
        """Play until the process was struck so often, and works again."""
        while len(self.recoveries) < tries:
            before = len(self.times)
            self._graph.interference = lambda: self._look(tries)
            try:
                self._graph.play()
            except SainError as error:
                print(f"{self._name}: {error}", flush=True)
                self.recoveries += [inf] * (len(self.times) - len(self.recoveries))
                self._due = self._draw()
            else:
                self.survived += len(self.times) - before
            finally:
                self._graph.interference = lambda: None

    def _look(self, tries: int) -> None:
        """Strike if it is time, and see whether the graph works again; called again and again."""
        now = time.monotonic()
        if len(self.recoveries) == len(self.times):
            if now >= self._due and len(self.times) < tries:
                self._strike(self._graph.process(self._name))
                self.times.append(time.monotonic())
            return
        struck, back = self.times[-1], self._graph.supervisor.back_at
        executed = self._graph.observed.latest
        if struck < back < executed:
            self.recoveries.append(executed - struck)
            self.spared.append((struck - 1.0, executed))
            self._due = self._draw()

    def _draw(self) -> float:
        return time.monotonic() + self._random.uniform(0.1, 2.0)


def lost_rows(bag: Any, observed: Observed, spared: list[tuple[float, float]]) -> int:
    """Return how many results are not in a bag, without those of times that are spared [s]."""
    recorded = {received.message.push_id for received in bag.messages(["/sain/push_result"])}
    lost = [
        one
        for at, one in observed.results
        if one.push_id not in recorded and not any(begin <= at <= end for begin, end in spared)
    ]
    for one in lost:
        print(f"not recorded: push {one.push_id}, code {one.error_code}", flush=True)
    return len(lost)
