"""The node that plays episodes on a running graph: resets, gives the goal, follows what happens."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from sain_bringup.graph import PLANNER, SEEN_BODIES
from sain_bringup.processes import Supervisor
from sain_bringup.ros.listener import GraphListener
from sain_bringup.ros.progress import (
    LOST,
    SERVER_PARTS,
    Missing,
    Progress,
    distance,
    missing_parts,
    seeing_nodes,
)
from sain_core.errors import ErrorCode, ModelUnavailableError, SainError, error_from_reply
from sain_core.guarding.ros.ownership import lock_namespace
from sain_core.ros.codec import encode_disks, encode_goal
from sain_core.ros.node_main import NAMESPACE, SIMULATED, node_of
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.shapes.body_file import write_tagged_bodies
from sain_core.shapes.library import own_bodies
from sain_eval.episode import Tolerance
from sain_eval.scenes.families import ScenarioScene
from sain_interfaces.msg import Goal, Plan, PushResult, Scene
from sain_interfaces.srv import ResetScene

SPIN: Final = 0.02  # [s], also how soon a signal or a dead process is noticed
LOOK: Final = 0.1  # [s] between looks at the graph: each costs some ms
REUNION: Final = 0.5  # [s] in which nodes find one that is back after a crash
SILENT: Final = 10.0  # [s] without any news, after which a goal is given again after a crash


class Sight:
    """What a director does beyond resets where bodies are seen. All calls return at once."""

    def __init__(self, node: Node, folder: Path, see: str, outlines: Path | None = None) -> None:
        """Write files of bodies into a folder, for the nodes that see them in this way.

        Shapes may be of a file of outlines.
        """
        self.see, self._sources = see, {}
        if outlines is not None:
            known = own_bodies(outlines).items()
            self._sources = {one.shape.name: f"{outlines.absolute()}:{name}" for name, one in known}
        self._folder, self._count = folder, 0
        self._clients = [
            AsyncParameterClient(node, node.resolve_topic_name(name)) for name in seeing_nodes(see)
        ]
        self._replies: list[Any] = []
        self._latest = self._before = self._episode = 0
        self._answered = False
        node.create_subscription(Scene, "scene", self._on_scene, RELIABLE)

    def show(self, case: ScenarioScene) -> None:
        """Have the nodes look for the bodies of a case, which lie on the table by now."""
        self._count += 1
        path = (self._folder / f"bodies_{self._count}.yaml").absolute()
        for one in (path, self._folder / SEEN_BODIES):  # the latter for a node that is restarted
            bodies = replace(case.bodies, heights=case.heights)
            write_tagged_bodies(one, case.disks, bodies, self._sources)
        self._episode, self._answered = 0, False
        given = [Parameter("bodies", value=str(path))]
        self._replies = [client.set_parameters(given) for client in self._clients]

    @property
    def episode_id(self) -> int:
        """The episode that began with what was shown last; 0: it has not begun."""
        if not self._answered and all(reply.done() for reply in self._replies):
            for one in (one for reply in self._replies for one in reply.result().results):
                if not one.successful:
                    raise SainError(f"a file of bodies was refused: {one.reason}")
            # Bodies must rest for a while before an episode begins: the next one is not here yet.
            self._answered, self._before = True, self._latest
        return self._episode

    def _on_scene(self, message: Scene) -> None:
        self._latest = max(self._latest, int(message.episode_id))
        if self._answered and message.settled and message.episode_id > self._before:
            self._episode = int(message.episode_id)


class GraphTimeoutError(SainError):
    """The graph did not do in time what it should."""


def reset_request(case: ScenarioScene) -> ResetScene.Request:
    """Return the request for the scene of a scenario."""
    return ResetScene.Request(
        seed=case.seed,
        disks=encode_disks(case.disks),
        shapes=list(case.shapes),
        roles=list(map(str, case.roles)),
        friction=case.friction,
    )


class Director(Node):
    """Plays episodes. All waiting is done in `wait`, which looks after the graph meanwhile."""

    def __init__(
        self,
        check: Callable[[], None],
        timeout: float,
        supervisor: Supervisor,
        sight: tuple[Path, str, Path | None] | None = None,
        show: Callable[[str], None] | None = None,
    ) -> None:
        """Join the graph. Wait for any one thing no longer than the timeout [s].

        While waiting, `check` is called again and again; it raises when the graph is broken. It
        may have the supervisor restart processes of the graph. Where bodies are seen by a camera,
        `sight` is a folder for their files, by what they are seen, and a file of their outlines.
        Once the graph is up, `show` prints what keeps it from working.

        Raises:
            BusyError: another graph runs already.
        """
        super().__init__("closed_loop", namespace=NAMESPACE, parameter_overrides=[SIMULATED])
        lock_namespace(self)()  # no other graph has it: the simulator to come locks it again
        self._check = check
        self._supervisor = supervisor
        self._timeout, self._show = timeout, show
        self._events: deque[Plan | PushResult] = deque()
        self._goals = 0
        self._planner_ready = False
        self._goal = self.create_publisher(Goal, "goal", LATCHED)
        self._servers = {n: self.create_client(kind, n) for n, kind in SERVER_PARTS.items()}
        for topic, kind in (("plan", Plan), ("push_result", PushResult)):
            self.create_subscription(kind, topic, self._on_news, RELIABLE)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)
        self._sight = None if sight is None else Sight(self, *sight)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def wait_for_graph(
        self, starting: Callable[[], list[str]], show: Callable[[str], None]
    ) -> None:
        """Wait until every part is up and connected; show which processes are waited for.

        `starting` returns the names of this run's own processes that are not ready. Without it
        another graph that runs already could pass for this one. The time begins anew with each
        part that comes, and with each sign of life of a process that starts.

        Raises:
            GraphTimeoutError: naming what is missing, and what it said last.
        """
        supervisor = self._supervisor
        missing = [Missing(name, name) for name in starting()]
        next_look = changed_at = 0.0

        def up() -> bool:
            nonlocal missing, next_look, changed_at
            if (now := time.monotonic()) >= next_look:
                next_look = now + LOOK
                before = missing
                missing = [Missing(name, f"{name} is ready") for name in starting()]
                missing = missing or self._missing()
                changed_at = changed_at if missing == before else now
                if missing:
                    show(", ".join(dict.fromkeys(part.process for part in missing)))
            return not missing

        def problem() -> str:
            what = ", ".join(part.what for part in missing)
            process = missing[0].process
            words = supervisor.last_words(process)
            stuck = f"; {process} makes no progress{words}" if words else ""
            return f"still missing: {what}{stuck}"

        def since() -> float:
            return max(changed_at, supervisor.heard_at([part.process for part in missing]))

        self.wait(up, problem, since)
        if self._show is not None:
            GraphListener(self, self._show, starts=True)

    def _missing(self) -> list[Missing]:
        missing = missing_parts(
            self, self._servers.values(), self._sight.see if self._sight else ""
        )
        if not self._planner_ready:  # what this node sees of the model, the planner may not yet
            missing.append(Missing(PLANNER, "the planner sees the model"))
        return missing

    def play(self, case: ScenarioScene, tolerance: float, progress: Progress) -> None:
        """Play one episode until all goals are reached in a row, or no push follows.

        The tolerance [m] is that of places; headings have 5 rad for each metre of it.

        Raises:
            SainError: the simulator refused the scene, or nothing happened any more.
        """
        self.wait(  # until what has crashed has found the others again
            lambda: time.monotonic() - self._supervisor.back_at > REUNION,
            lambda: "a process that crashed is not back",
        )
        episode_id = self._reset(case, progress)
        self._events.clear()
        for goal in map(Tolerance(tolerance).apply, case.goals):
            part = replace(case, goal=goal, further=())
            self._pursue(part, episode_id, progress, len(case.goals))
            if not progress.reached:
                break

    def _pursue(
        self, case: ScenarioScene, episode_id: int, progress: Progress, most_goals: int
    ) -> None:
        """Give the goal of a case, and follow what happens until the planner is done with it.

        Where a crash may have swallowed the last news of the goal, it is given again.
        """
        goal = self._give_goal(case, episode_id)
        progress.begin(goal.goal_id, case, most_goals)
        given = time.monotonic()

        def over() -> bool:
            nonlocal given
            if self._follow(episode_id, progress):
                given = time.monotonic()
            now = time.monotonic()
            if -inf < self._supervisor.back_at < now - SILENT and given < now - SILENT:
                given = now
                self._goal.publish(goal)
            return progress.is_over(self._supervisor.back_at)

        self.wait(over, lambda: "no sign of planner or simulator", since=lambda: progress.heard_at)

    def _follow(self, episode_id: int, progress: Progress) -> int:
        """Tell the progress all news of an episode; return how many there were."""
        count = len(self._events)
        while self._events:
            event = self._events.popleft()
            if event.episode_id != episode_id:
                continue
            (progress.on_plan if isinstance(event, Plan) else progress.on_result)(event)
        return count

    def wait(
        self,
        done: Callable[[], bool],
        problem: Callable[[], str],
        since: Callable[[], float] = lambda: -inf,
    ) -> None:
        """Spin until a condition holds; no longer than the timeout from now, or `since` then [s].

        Raises:
            GraphTimeoutError: it did not hold in time; with the problem in words.
        """
        begun = time.monotonic()
        while not done():
            self._executor.spin_once(timeout_sec=SPIN)
            self._check()
            now = time.monotonic()
            if now > max(begun, since()) + self._timeout:
                raise GraphTimeoutError(f"waited {self._timeout:g} s for the graph; {problem()}")

    def call(self, name: str, request: Any) -> Any:
        """Call a service and return its reply; a request that a crash swallowed is sent again.

        Raises:
            SainError: what the server reported.
            GraphTimeoutError: it did not answer.
        """
        asked_at, future = time.monotonic(), self._servers[name].call_async(request)

        def answered() -> bool:
            nonlocal asked_at, future
            now, back = time.monotonic(), self._supervisor.back_at
            due = back + REUNION if asked_at < back + REUNION else asked_at + LOST
            if back > -inf and now > due and not future.done():
                asked_at, future = now, self._servers[name].call_async(request)
            return bool(future.done())

        self.wait(answered, lambda: f"{name} did not answer")
        reply = future.result()
        if reply is None:
            raise ModelUnavailableError(f"{name} gave no answer")
        if reply.error_code != ErrorCode.OK:
            raise error_from_reply(reply.error_code, f"{name}: {reply.error_message}")
        return reply

    def _reset(self, case: ScenarioScene, progress: Progress) -> int:
        scene = self.call("reset_scene", reset_request(case)).scene
        progress.at(distance(case, scene))
        if (sight := self._sight) is None:
            return int(scene.episode_id)
        sight.show(case)
        self.wait(lambda: sight.episode_id > 0, lambda: "the bodies are not seen at rest")
        return sight.episode_id

    def _give_goal(self, case: ScenarioScene, episode_id: int) -> Goal:
        self._goals += 1
        named = {"goal_id": self._goals, "episode_id": episode_id, "max_pushes": case.max_pushes}
        message = encode_goal(case.goal, stamp=self.get_clock().now().to_msg(), **named)
        self._goal.publish(message)
        return message

    def _on_news(self, message: Plan | PushResult) -> None:
        self._events.append(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        planner = self.resolve_topic_name("mppi_node")
        for status in message.status:
            if node_of(status) == planner:
                self._planner_ready = status.level == DiagnosticStatus.OK
