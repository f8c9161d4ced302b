"""What the page asks of the graph: goals, resets, parameters and models."""

import time
from collections.abc import Callable, Mapping
from queue import SimpleQueue
from typing import Any, Final

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from sain_core.errors import ErrorCode
from sain_core.ros.codec import encode_disks, encode_goal
from sain_core.ros.qos import RELIABLE
from sain_core.ros.steady import steady_timer
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_interfaces.action import Reach
from sain_interfaces.msg import Goal, Plan
from sain_interfaces.srv import DescribeModel, LoadModel, ResetScene
from sain_live.aims import Aim
from sain_live.orders import Reset
from sain_live.page.planner_form import settings_of
from sain_live.state import Kind, Known, Phase
from sain_mppi.ros.goal_message import encode_pose_goal
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.poses import PoseGoal

PLANNER: Final = "mppi_node"
LOOK_AROUND: Final = 0.5  # [s]
AGAIN: Final = 0.1  # [s] between attempts to reset while a push is under way
PATIENCE: Final = 60.0  # [s] for that push


class Asking:
    """Carries out the orders of viewers, on the executor's thread."""

    def __init__(self, node: Node, known: Known) -> None:
        """Look for the others."""
        self._node, self._known = node, known
        self._orders: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._guard = node.create_guard_condition(self._carry_out)
        self._reach = ActionClient(node, Reach, "reach")
        self._reset_scene = node.create_client(ResetScene, "reset_scene")
        self._load_model = node.create_client(LoadModel, "load_model")
        self._describe = node.create_client(DescribeModel, "describe_model")
        self._set = node.create_client(SetParameters, f"{PLANNER}/set_parameters")
        self._get = node.create_client(GetParameters, f"{PLANNER}/get_parameters")
        self._names = [name for _, name, _, _ in settings_of(PlannerConfig())]
        self._handle: Any = None  # of the goal that is followed
        self._goal = 0  # number of it
        self._wanted: dict[str, Any] = {}  # parameters to set
        self._setting = self._got = self._described = False
        self._retry: tuple[float, Callable[[], None]] | None = None
        steady_timer(node, AGAIN, self._try_again)
        steady_timer(node, LOOK_AROUND, self._look_around)
        events = "/parameter_events"
        node.create_subscription(ParameterEvent, events, self._on_parameters, RELIABLE)

    @property
    def has_simulator(self) -> bool:
        """Whether there is one that can be reset."""
        return bool(self._reset_scene.service_is_ready())

    # --- orders, from any thread

    def start(self) -> None:
        """Follow the goal, push by push."""
        self._put(lambda: self._follow(0))

    def push_once(self) -> None:
        """Follow the goal for one push."""
        self._put(lambda: self._follow(1))

    def pause(self) -> None:
        """Follow no goal any more."""
        self._put(self._pause)

    def aim(self, aim: Aim) -> None:
        """Take a goal that was dragged: follow it, unless the loop is paused."""
        self._put(self._take_aim)

    def reset(self, reset: Reset) -> None:
        """Start a new episode; raises `ConfigError` where there is no such scene."""
        case = reset.case()
        self._put(lambda: self._begin_reset(case, reset.world))

    def set(self, name: str, value: Any) -> None:
        """Change a parameter of the planner."""
        self._put(lambda: self._set_one(name, value))

    def load(self, model: str) -> None:
        """Serve another model."""
        self._put(lambda: self._load(model))

    def _put(self, order: Callable[[], None]) -> None:
        self._orders.put(order)
        self._guard.trigger()

    # --- on the executor's thread

    def _carry_out(self) -> None:
        while not self._orders.empty():
            self._orders.get()()

    def _refuse(self, text: str) -> None:
        self._known.tell(Kind.REFUSAL, text)

    def _take_aim(self) -> None:
        if self._known.followed:
            self._follow(0)
        else:
            self._known.tell(Kind.NOTE, "the goal is placed; Start follows it")

    def _follow(self, most: int) -> None:
        known = self._known
        if known.aim is None or known.scene is None:
            return self._refuse("there is no goal yet: no scene was seen")
        if not self._reach.server_is_ready():
            where = self._node.resolve_topic_name("reach")
            return self._refuse(f"no planner answers on {where}; a recording cannot be steered")
        known.update(followed=most == 0)
        self._goal += 1
        number = self._goal
        goal = goal_message(known.aim, known.scene.episode_id, most, self._stamp())
        sent = self._reach.send_goal_async(Reach.Goal(goal=goal))
        sent.add_done_callback(lambda done: self._on_accepted(number, done))

    def _on_accepted(self, number: int, done: Any) -> None:
        handle = done.result()
        if handle is None or not handle.accepted:
            return self._refuse("the planner did not take the goal")
        if number != self._goal:  # a newer one, or a pause, was faster
            handle.cancel_goal_async()
            return None
        self._handle = handle
        handle.get_result_async().add_done_callback(lambda ended: self._on_end(number, ended))
        return None

    def _on_end(self, number: int, done: Any) -> None:
        if number != self._goal:
            return
        self._handle, result = None, done.result().result
        if result.status == Plan.REACHED:
            count = f"{result.pushes} push{'' if result.pushes == 1 else 'es'}"
            text = f"reached with {count}, {1e3 * result.goal_distance:.0f} mm from the goal"
            self._known.tell(Kind.NOTE, text)

    def _pause(self) -> None:
        self._goal += 1
        self._known.update(followed=False)
        if self._handle is not None:
            self._handle.cancel_goal_async()
            self._handle = None
        elif self._known.phase in (Phase.PLANNING, Phase.PUSHING):
            self._known.tell(Kind.NOTE, "the goal is another sender's; it ends by its own")

    def _begin_reset(self, case: ScenarioScene, world: str) -> None:
        if not self._reset_scene.service_is_ready():
            where = self._reset_scene.srv_name
            return self._refuse(f"no simulator answers on {where}: reset a robot by hand")
        if self._handle is not None or self._known.followed:
            self._pause()
        request = ResetScene.Request(
            seed=case.seed,
            world=world,
            disks=encode_disks(case.disks),
            shapes=list(case.shapes),
            roles=list(map(str, case.roles)),
            friction=case.friction,
        )
        self._ask_reset(case, request, time.monotonic() + PATIENCE)
        return None

    def _ask_reset(self, case: ScenarioScene, request: Any, until: float) -> None:
        def on_reply(done: Any) -> None:
            reply, known = done.result(), self._known
            if reply.error_code == ErrorCode.BUSY and time.monotonic() < until:
                known.update(why="waits for the push under way, to reset")
                self._retry = time.monotonic(), lambda: self._ask_reset(case, request, until)
            elif reply.error_code != ErrorCode.OK:
                self._refuse(f"reset: {reply.error_message}")
            else:
                known.update(aim=Aim(case.goal), phase=Phase.PAUSED, why="", pushes=0)
                known.tell(Kind.NOTE, f"{case.scenario}, seed {case.seed}")

        self._retry = None
        self._reset_scene.call_async(request).add_done_callback(on_reply)

    def _try_again(self) -> None:
        if self._retry is not None:
            self._retry[1]()

    def _set_one(self, name: str, value: Any) -> None:
        self._wanted[name] = value
        if not self._setting:
            self._send_settings()

    def _send_settings(self) -> None:
        """Send the latest of each setting; one request at a time, as sliders are fast."""
        if not self._set.service_is_ready():
            self._wanted.clear()
            self._known.update(planner=dict(self._known.planner))
            return self._refuse("no planner is there to take a setting")
        wanted, self._wanted, self._setting = self._wanted, {}, True
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in wanted.items()
        ]
        self._set.call_async(request).add_done_callback(lambda done: self._on_set(wanted, done))
        return None

    def _on_set(self, wanted: Mapping[str, Any], done: Any) -> None:
        self._setting, planner = False, dict(self._known.planner)
        for (name, value), result in zip(wanted.items(), done.result().results, strict=True):
            if result.successful:
                planner[name] = value
            else:
                self._refuse(f"{name} = {value!r}: {result.reason}")
        self._known.update(planner=planner)  # also where refused: the control goes back
        if self._wanted:
            self._send_settings()

    def _load(self, model: str) -> None:
        if not self._load_model.service_is_ready():
            return self._refuse("no model's node is there to load another model")
        self._known.tell(Kind.NOTE, f"loads {model}")

        def on_reply(done: Any) -> None:
            reply = done.result()
            if reply.error_code != ErrorCode.OK:
                self._refuse(f"load {model}: {reply.error_message}")
            else:
                self._known.update(model=reply.model)
                self._known.tell(Kind.NOTE, f"the model is {reply.model}")

        self._load_model.call_async(LoadModel.Request(model=model)).add_done_callback(on_reply)
        return None

    def _look_around(self) -> None:
        """Ask who is new what the page should know."""
        if not self._get.service_is_ready():
            self._got = False
        elif not self._got:
            self._got = True
            asked = self._get.call_async(GetParameters.Request(names=self._names))
            asked.add_done_callback(self._on_got)
        if not self._describe.service_is_ready():
            self._described = False
        elif not self._described:
            self._described = True
            asked = self._describe.call_async(DescribeModel.Request())
            asked.add_done_callback(lambda done: self._known.update(model=done.result().model))

    def _on_got(self, done: Any) -> None:
        values = map(parameter_value_to_python, done.result().values)
        self._known.update(planner=dict(zip(self._names, values, strict=False)))

    def _on_parameters(self, event: ParameterEvent) -> None:
        if event.node != self._node.resolve_topic_name(PLANNER):
            return
        changed = {
            one.name: parameter_value_to_python(one.value)
            for one in (*event.new_parameters, *event.changed_parameters)
            if one.name in self._names
        }
        if changed:
            self._known.update(planner={**self._known.planner, **changed})

    def _stamp(self) -> Any:
        return self._node.get_clock().now().to_msg()


def goal_message(aim: Aim, episode_id: int, most: int, stamp: Any) -> Goal:
    """Return a goal for so many pushes; 0: no limit."""
    named = {"stamp": stamp, "goal_id": 0, "episode_id": episode_id, "max_pushes": most}
    if isinstance(aim.goal, PoseGoal):
        return encode_pose_goal(aim.goal, **named)
    return encode_goal(aim.goal, tolerance=aim.tolerance, **named)
