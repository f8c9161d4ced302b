"""The planner's parameters and the model: as they are, and as viewers want them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from sain_core.errors import ErrorCode
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import RELIABLE
from sain_interfaces.srv import DescribeModel, LoadModel
from sain_live.settings import planner_settings
from sain_live.state import Level, LiveState
from sain_model.compute.kernel_store import describe_compilation

PLANNER: Final = "mppi_node"
LEARNER: Final = "learner_node"
LEARNS: Final = "learns"  # its parameter
LOOK_AROUND: Final = 0.5  # [s]


@dataclass
class _Node:
    """Another node: what it is asked once it is there, and what follows its end."""

    name: str  # in the log; empty: it is not mentioned
    client: Client
    request: Any
    on_reply: Callable[[Any], None]
    on_end: Callable[[], None]
    there: bool = False
    came: bool = False


class Tuning:
    """Follows and changes parameters and model. All calls come from the executor's thread."""

    def __init__(self, node: Node, state: LiveState, has_simulator: Callable[[], bool]) -> None:
        self._node, self._state, self._has_simulator = node, state, has_simulator
        self._load_model = node.create_client(LoadModel, "load_model")
        self._set = node.create_client(SetParameters, f"{PLANNER}/set_parameters")
        self._set_learner = node.create_client(SetParameters, f"{LEARNER}/set_parameters")
        planner, learner = (
            node.create_client(GetParameters, f"{name}/get_parameters")
            for name in (PLANNER, LEARNER)
        )
        self._names = [one.name for one in planner_settings()]
        self._wanted: dict[str, Any] = {}  # parameters to set
        self._setting = False
        settings = GetParameters.Request(names=self._names)
        learns = GetParameters.Request(names=[LEARNS])
        self._nodes = (
            _Node("the planner", planner, settings, self._on_planner, self._end_planner),
            _Node(
                "the model",
                node.create_client(DescribeModel, "describe_model"),
                DescribeModel.Request(),
                lambda done: state.update(model=done.result().model),
                lambda: state.update(loading=""),  # it may have ended before it could answer
            ),
            _Node(
                "",
                learner,
                learns,
                lambda done: state.update(learns=done.result().values[0].bool_value),
                lambda: state.update(learns=None),
            ),
        )
        steady_timer(node, LOOK_AROUND, self._look_around)
        events = "/parameter_events"
        node.create_subscription(ParameterEvent, events, self._on_parameters, RELIABLE)

    def set(self, name: str, value: Any) -> None:
        """Change a parameter of the planner."""
        self._wanted[name] = value
        if not self._setting:
            self._send_settings()

    def _send_settings(self) -> None:
        """Send the latest of each setting; one request at a time, as sliders are fast."""
        if not self._set.service_is_ready():
            self._wanted.clear()
            self._state.update(planner=dict(self._state.planner))
            self._state.tell(Level.REFUSAL, "no planner is there to take a setting")
            return
        wanted, self._wanted, self._setting = self._wanted, {}, True
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in wanted.items()
        ]
        self._set.call_async(request).add_done_callback(lambda done: self._on_set(wanted, done))

    def _on_set(self, wanted: Mapping[str, Any], done: Any) -> None:
        self._setting, planner = False, dict(self._state.planner)
        for (name, value), result in zip(wanted.items(), done.result().results, strict=True):
            if result.successful:
                planner[name] = value
            else:
                self._state.tell(Level.REFUSAL, f"{name} = {value!r}: {result.reason}")
        self._state.update(planner=planner)  # also where refused: the control goes back
        if self._wanted:
            self._send_settings()

    def load(self, model: str) -> None:
        """Serve another model."""
        if not self._load_model.service_is_ready():
            self._state.tell(Level.REFUSAL, "no model's node is there to load another model")
            return
        self._state.update(loading=model)
        self._state.tell(Level.NOTE, f"loads {model}")

        def on_reply(done: Any) -> None:
            reply = done.result()
            self._state.update(model=reply.model, loading="")
            if reply.error_code == ErrorCode.OK:
                self._state.tell(Level.NOTE, f"the model is {reply.model}")
            else:
                stays = f"{reply.model} stays"
                self._state.tell(Level.REFUSAL, f"load {model}: {reply.error_message}; {stays}")

        self._load_model.call_async(LoadModel.Request(model=model)).add_done_callback(on_reply)

    def learn(self, learns: bool) -> None:
        """Learn from pushes, or not; the learner's own events tell what came of it."""
        if self._set_learner.service_is_ready():
            parameter = Parameter(LEARNS, value=learns).to_parameter_msg()
            self._set_learner.call_async(SetParameters.Request(parameters=[parameter]))

    def _look_around(self) -> None:
        """Ask each node that is new for what the page shows; log which come and go."""
        for node in self._nodes:
            there = bool(node.client.service_is_ready())
            if there == node.there:
                continue
            node.there = there
            if node.name:
                node.came = True
                kind = Level.NOTE if there else Level.FAULT
                self._state.tell(kind, f"{node.name} is {'ready' if there else 'gone'}")
            if there:
                node.client.call_async(node.request).add_done_callback(node.on_reply)
            else:
                node.on_end()
        missing = [node.name for node in self._nodes if node.name and not node.came]
        text = describe_compilation() if missing else ""
        if not text and 0 < len(missing) < 2 + self._has_simulator():  # else a recording
            text = f"waits for {' and '.join(missing)}"
        if text != self._state.starting:
            self._state.update(starting=text)

    def _on_planner(self, done: Any) -> None:
        values = map(parameter_value_to_python, done.result().values)
        self._state.update(planner=dict(zip(self._names, values, strict=False)))

    def _end_planner(self) -> None:
        self._setting = False  # it answers nothing any more

    def _on_parameters(self, event: ParameterEvent) -> None:
        given = {
            one.name: parameter_value_to_python(one.value)
            for one in (*event.new_parameters, *event.changed_parameters)
        }
        if event.node == self._node.resolve_topic_name(LEARNER) and LEARNS in given:
            self._state.update(learns=given[LEARNS])
        changed = {name: value for name, value in given.items() if name in self._names}
        if event.node == self._node.resolve_topic_name(PLANNER) and changed:
            self._state.update(planner={**self._state.planner, **changed})
