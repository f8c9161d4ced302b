"""Carries out requests: goals and resets; parameters and models are in `tuning`."""

import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, Final

from rclpy.action import ActionClient
from rclpy.node import Node

from sain_bringup.ros.director import reset_request
from sain_core.errors import ErrorCode
from sain_core.ros.codec import encode_goal
from sain_core.ros.node_main import steady_timer
from sain_eval.scenes.families import ScenarioScene
from sain_interfaces.action import Reach
from sain_interfaces.msg import Plan
from sain_interfaces.srv import ResetScene
from sain_live.requests import (
    Follow,
    Learn,
    LoadModel,
    Pause,
    Request,
    Reset,
    SetGoal,
    SetParameter,
)
from sain_live.ros.tuning import Tuning
from sain_live.state import Level, LiveState, Phase

AGAIN: Final = 0.1  # [s] between attempts to reset while a push is under way
PATIENCE: Final = 60.0  # [s] for that push


class Steering:
    """Carries out the requests of viewers, on the executor's thread."""

    def __init__(self, node: Node, state: LiveState) -> None:
        self._node, self._state = node, state
        self._requests: SimpleQueue[Request] = SimpleQueue()
        self._guard = node.create_guard_condition(self._carry_out)
        self._reach = ActionClient(node, Reach, "reach")
        self._reset_scene = node.create_client(ResetScene, "reset_scene")
        self._tuning = Tuning(node, state, lambda: self.has_simulator)
        self._handle: Any = None  # of the goal that is followed
        self._goal = 0  # number of it
        self._retry: Callable[[], None] | None = None  # sends a reset again
        steady_timer(node, AGAIN, self._try_again)

    @property
    def has_simulator(self) -> bool:
        """Whether there is one that can be reset."""
        return bool(self._reset_scene.service_is_ready())

    def send(self, request: Request) -> None:
        """Take a request, from any thread."""
        self._requests.put(request)
        self._guard.trigger()

    def _carry_out(self) -> None:
        while not self._requests.empty():
            match self._requests.get():
                case Follow(most):
                    self._follow(most)
                case Pause():
                    self._pause()
                case Reset() as reset:
                    self._begin_reset(reset)
                case SetGoal():
                    self._take_goal()
                case SetParameter(name, value):
                    self._tuning.set(name, value)
                case LoadModel(model):
                    self._tuning.load(model)
                case Learn(enabled):
                    self._tuning.learn(enabled)

    def _refuse(self, text: str) -> None:
        self._state.tell(Level.REFUSAL, text)

    def _take_goal(self) -> None:
        if self._state.followed:
            self._follow(0)
        else:
            self._state.tell(Level.NOTE, "the goal is placed; Start follows it")

    def _follow(self, most: int) -> None:
        state = self._state
        if state.aim is None or state.scene is None:
            self._refuse("there is no goal yet: no scene was seen")
            return
        if not self._reach.server_is_ready():
            where = self._node.resolve_topic_name("reach")
            alone = f"no planner answers on {where}; a recording cannot be steered"
            self._refuse(f"not yet: {state.starting}" if state.starting else alone)
            return
        state.update(followed=most == 0)
        self._goal += 1
        number = self._goal
        stamp = self._node.get_clock().now().to_msg()
        about = {"episode_id": state.scene.episode_id, "max_pushes": most}
        goal = encode_goal(state.aim, stamp=stamp, goal_id=0, **about)
        sent = self._reach.send_goal_async(Reach.Goal(goal=goal))
        sent.add_done_callback(lambda done: self._on_accepted(number, done))

    def _on_accepted(self, number: int, done: Any) -> None:
        handle = done.result()
        if handle is None or not handle.accepted:
            self._refuse("the planner did not take the goal")
            return
        if number != self._goal:  # a newer one, or a pause, was faster
            handle.cancel_goal_async()
        self._handle = handle
        handle.get_result_async().add_done_callback(lambda ended: self._on_end(number, ended))

    def _on_end(self, number: int, done: Any) -> None:
        if number != self._goal:
            return
        self._handle, result = None, done.result().result
        if result.status == Plan.REACHED:
            count = f"{result.pushes} push{'' if result.pushes == 1 else 'es'}"
            text = f"reached with {count}, {1e3 * result.goal_distance:.0f} mm from the goal"
            self._state.tell(Level.NOTE, text)

    def _pause(self) -> None:
        self._goal += 1
        self._state.update(followed=False)
        if self._handle is not None:
            self._handle.cancel_goal_async()
            self._handle = None
        elif self._state.phase in (Phase.PLANNING, Phase.PUSHING):
            self._state.tell(Level.NOTE, "the goal is another sender's; it ends by its own")

    def _begin_reset(self, reset: Reset) -> None:
        if not self._reset_scene.service_is_ready():
            where = self._reset_scene.srv_name
            self._refuse(f"no simulator answers on {where}: reset a robot by hand")
            return
        if self._handle is not None or self._state.followed:
            self._pause()
        request = reset_request(reset.case)
        request.world = reset.world
        self._ask_reset(reset.case, request, time.monotonic() + PATIENCE)

    def _try_again(self) -> None:
        retry, self._retry = self._retry, None
        if retry is not None:
            retry()

    def _ask_reset(self, case: ScenarioScene, request: Any, until: float) -> None:
        def on_reply(done: Any) -> None:
            reply, state = done.result(), self._state
            if reply.error_code == ErrorCode.BUSY and time.monotonic() < until:
                state.update(why="waits for the push under way, to reset")
                self._retry = lambda: self._ask_reset(case, request, until)
            elif reply.error_code != ErrorCode.OK:
                self._refuse(f"reset: {reply.error_message}")
            else:
                state.update(aim=case.goal, phase=Phase.PAUSED, why="", pushes=0)
                state.tell(Level.NOTE, f"{case.scenario}, seed {case.seed}")

        self._reset_scene.call_async(request).add_done_callback(on_reply)
