"""The node that plays episodes on a running graph: resets, gives the goal, follows what happens."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_bringup.display import EpisodeView
from sain_bringup.graph import PLANNER
from sain_bringup.processes import Supervisor
from sain_bringup.ros.readiness import SERVER_PARTS, Missing, missing_parts
from sain_core.errors import ErrorCode, ModelUnavailableError, SainError, error_from_reply
from sain_core.ros.codec import encode_disks, encode_goal
from sain_core.ros.diagnostics import node_of
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.peers import refuse_peers, refuse_rivals
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.ros.steady import SIMULATED
from sain_core.scene import target_distance
from sain_core.shapes.bodies import Bodies
from sain_core.wire import decode_disks
from sain_eval.scenes.scenarios import ScenarioScene
from sain_interfaces.msg import Goal, Plan, PushPrediction, PushResult, Scene
from sain_interfaces.srv import ResetScene
from sain_mppi.ros.goal_message import encode_pose_goal
from sain_mppi.search.poses import PoseGoal

SPIN: Final = 0.02  # [s], also how soon a signal or a dead process is noticed
LOOK: Final = 0.1  # [s] between looks at the graph: each costs some ms
EARLY: Final = 0.5  # [s] in which no simulator that was just started can publish
OWNED: Final = ("scene", "push", "goal", "/clock")  # topics with one publisher in a graph
REUNION: Final = 0.5  # [s] in which nodes find one that is back after a crash
LOST: Final = 5.0  # [s] after which a request has got lost, where a process has crashed
SILENT: Final = 10.0  # [s] without any news, after which a goal is given again after a crash
PREDICTION_TIME: Final = 5.0  # [s] for the nominal world to predict the last push


class GraphTimeoutError(SainError):
    """The graph did not do in time what it should."""


class Director(Node):
    """Plays episodes. All waiting is done in `wait`, which looks after the graph meanwhile."""

    def __init__(
        self, check: Callable[[], None], timeout: float, supervisor: Supervisor | None = None
    ) -> None:
        """Join the graph. Wait for any one thing no longer than the timeout [s].

        While waiting, `check` is called again and again; it raises when the graph is broken. It
        may have the supervisor restart processes of the graph.
        """
        super().__init__("closed_loop", namespace=NAMESPACE, parameter_overrides=[SIMULATED])
        self._joined = time.monotonic()
        self._next_look = self._joined
        self._check = check
        self._supervisor = supervisor
        self._timeout = timeout
        self._events: deque[Plan | PushResult] = deque()
        self._last_sent = 0
        self._sent: set[int] = set()  # ids of pushes: those planned, ...
        self._answered: set[int] = set()  # ... those with a result, ...
        self._executed: set[int] = set()  # ... those carried out, ...
        self._predicted: set[int] = set()  # ... and those that the nominal world predicted
        self._goals = 0
        self._planner_ready = False
        self._graph_is_up = False
        self._goal = self.create_publisher(Goal, "goal", LATCHED)
        self._servers = {n: self.create_client(kind, n) for n, kind in SERVER_PARTS.items()}
        self.create_subscription(Plan, "plan", self._on_event, RELIABLE)
        self.create_subscription(PushResult, "push_result", self._on_event, RELIABLE)
        self.create_subscription(
            PushPrediction, "physics_prediction", self._on_prediction, RELIABLE
        )
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def wait_for_graph(
        self, starting: Callable[[], list[str]], show: Callable[[str], None]
    ) -> None:
        """Wait until every part is up and connected; show which processes are waited for.

        `starting` returns the names of this run's own processes that are not ready. Without it
        another graph that runs already could pass for this one.

        Raises:
            GraphTimeoutError: naming what is missing.
            BusyError: another graph runs already.
        """
        missing = [Missing(name, name) for name in starting()]
        next_look = 0.0

        def up() -> bool:
            nonlocal missing, next_look
            if (now := time.monotonic()) >= next_look:
                next_look = now + LOOK
                if now - self._joined < EARLY:
                    refuse_peers(self, ("scene", "push", "/clock"), 0.0)
                missing = [Missing(name, f"{name} is ready") for name in starting()]
                missing = missing or self._missing()
                show(", ".join(dict.fromkeys(part.process for part in missing)))
            return not missing

        self.wait(up, lambda: f"still missing: {', '.join(part.what for part in missing)}")
        refuse_rivals(self, OWNED)
        self._graph_is_up = True

    def _missing(self) -> list[Missing]:
        missing = missing_parts(self, self._servers.values())
        if not self._planner_ready:  # what this node sees of the model, the planner may not yet
            missing.append(Missing(PLANNER, "the planner sees the model"))
        return missing

    def play(self, case: ScenarioScene, tolerance: float, view: EpisodeView) -> None:
        """Play one episode until all goals are reached in a row, or no push follows.

        The tolerance [m] is that of a goal of the target; poses have their own.

        Raises:
            SainError: the simulator refused the scene, or nothing happened any more.
        """
        self._wait_for_restarts()
        episode_id = self._reset(case, view)
        for known in (self._events, self._sent, self._answered, self._executed, self._predicted):
            known.clear()
        for goal in case.goals:
            view.begin(len(case.goals))
            self._pursue(replace(case, goal=goal, further=()), episode_id, tolerance, view)
            if not view.reached:
                break
        self._wait_for_predictions()

    def _wait_for_restarts(self) -> None:
        """Wait until what has crashed is back, and has found the others."""
        self.wait(
            lambda: time.monotonic() - self._back_at() > REUNION,
            lambda: "a process that crashed is not back",
        )

    def _back_at(self) -> float:
        """The time [s] when the last process came back that had crashed; never, if one is not."""
        return -inf if self._supervisor is None else self._supervisor.back_at

    def _pursue(
        self, case: ScenarioScene, episode_id: int, tolerance: float, view: EpisodeView
    ) -> None:
        """Give the goal of a case, and follow what happens until the planner is done with it."""
        goal = self._give_goal(case, episode_id, tolerance)
        while not self._is_over(view):
            self._wait_for_event(goal)
            event = self._events.popleft()
            if event.episode_id == episode_id:
                self._follow(event, case, view)

    def _wait_for_event(self, goal: Goal) -> None:
        """Wait for news of the goal; give it again where a crash may have swallowed the last."""
        since = time.monotonic()

        def heard() -> bool:
            nonlocal since
            now = time.monotonic()
            if -inf < self._back_at() < now - SILENT and since < now - SILENT:
                since = now
                self._goal.publish(goal)
            return bool(self._events)

        self.wait(heard, lambda: "no sign of planner or simulator")

    def wait(self, done: Callable[[], bool], problem: Callable[[], str]) -> None:
        """Spin until a condition holds.

        Raises:
            GraphTimeoutError: it did not hold in time; with the problem in words.
            BusyError: while this graph starts, another one publishes the same topics.
        """
        deadline = time.monotonic() + self._timeout
        while not done():
            self._executor.spin_once(timeout_sec=SPIN)
            self._check()
            now = time.monotonic()
            if not self._graph_is_up and now > self._next_look:  # the one that runs goes on
                self._next_look = now + 5.0 * LOOK
                refuse_rivals(self, OWNED)
            if now > deadline:
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
            now, back = time.monotonic(), self._back_at()
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

    def _reset(self, case: ScenarioScene, view: EpisodeView) -> int:
        request = ResetScene.Request(
            seed=case.seed,
            disks=encode_disks(case.disks),
            shapes=list(case.shapes),
            roles=list(map(str, case.roles)),
            friction=case.friction,
        )
        scene = self.call("reset_scene", request).scene
        view.at(_distance(case, scene))
        return int(scene.episode_id)

    def _give_goal(self, case: ScenarioScene, episode_id: int, tolerance: float) -> Goal:
        self._goals += 1
        self._sent.clear()
        self._last_sent = 0
        named = {"goal_id": self._goals, "episode_id": episode_id, "max_pushes": case.max_pushes}
        stamp = self.get_clock().now().to_msg()
        if isinstance(case.goal, PoseGoal):
            message = encode_pose_goal(case.goal, stamp=stamp, **named)
        else:
            message = encode_goal(case.goal, stamp=stamp, tolerance=tolerance, **named)
        self._goal.publish(message)
        return message

    def _is_over(self, view: EpisodeView) -> bool:
        """Tell whether the planner is done, and so is the last push it sent: news may overtake.

        One before it that has no answer was lost with the process that should have given it.
        """
        return bool(view.ending) and self._last_sent in (0, *self._answered)

    def _follow(self, event: Plan | PushResult, case: ScenarioScene, view: EpisodeView) -> None:
        if isinstance(event, Plan):
            self._on_plan(event, view)
            return
        self._answered.add(event.push_id)
        if event.error_code == ErrorCode.OK:
            self._executed.add(event.push_id)
            view.at(_distance(case, event.after))
        else:
            view.refuse(event.error_message)

    def _on_plan(self, plan: Plan, view: EpisodeView) -> None:
        if plan.goal_id != self._goals:
            return
        if plan.status == Plan.PUSH:
            self._sent.add(plan.push_id)
            self._last_sent = plan.push_id
            view.planned(plan.planning_time, plan.fallback, plan.error_message)
        elif plan.status == Plan.REACHED:
            view.end(reached=True)
        elif plan.status == Plan.EXHAUSTED:
            view.end(reached=False, why=f"no pushes left of {len(self._sent)}")
        else:
            view.end(reached=False, why=plan.error_message or "the planner found no push")

    def _on_event(self, message: Plan | PushResult) -> None:
        self._events.append(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        planner = self.resolve_topic_name("mppi_node")
        for status in message.status:
            if node_of(status) == planner:
                self._planner_ready = status.level == DiagnosticStatus.OK

    def _on_prediction(self, message: PushPrediction) -> None:
        self._predicted.add(message.push_id)

    def _wait_for_predictions(self) -> None:
        """Wait for the nominal world's word on every push; without a shadow world it has none."""
        deadline = time.monotonic() + PREDICTION_TIME
        self.wait(
            lambda: self._executed <= self._predicted or time.monotonic() > deadline,
            lambda: "no physics predictions",
        )


def _distance(case: ScenarioScene, message: Scene) -> float:
    """Return the distance [m] from the target to the goal, or the largest of bodies to poses."""
    scene = decode_disks(message.disks)
    if not isinstance(case.goal, PoseGoal):
        return float(target_distance(scene, case.goal))
    bodies = Bodies.named(case.shapes, case.roles)
    return float(case.goal.errors(scene, bodies)[0].max())
