"""The planner's parameters and the model: as they are, and as viewers want them."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from sain_core.errors import ErrorCode
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import RELIABLE
from sain_interfaces.srv import DescribeModel, LoadModel
from sain_live.orders import planner_settings
from sain_live.state import Level, LiveState
from sain_model.compute.kernel_store import describe_compilation

PLANNER: Final = "mppi_node"
LEARNER: Final = "learner_node"
LEARNS: Final = "learns"  # its parameter
LOOK_AROUND: Final = 0.5  # [s]


class Tuning:
    """Follows and changes parameters and model. All calls come from the executor's thread."""

    def __init__(self, node: Node, known: LiveState, has_simulator: Callable[[], bool]) -> None:
        """Look for planner and model."""
        self._node, self._known, self._has_simulator = node, known, has_simulator
        self._load_model = node.create_client(LoadModel, "load_model")
        self._describe = node.create_client(DescribeModel, "describe_model")
        self._set = node.create_client(SetParameters, f"{PLANNER}/set_parameters")
        self._get = node.create_client(GetParameters, f"{PLANNER}/get_parameters")
        self._set_learner = node.create_client(SetParameters, f"{LEARNER}/set_parameters")
        self._get_learner = node.create_client(GetParameters, f"{LEARNER}/get_parameters")
        self._names = [name for _, name, _, _ in planner_settings()]
        self._wanted: dict[str, Any] = {}  # parameters to set
        self._setting = self._got = self._described = False
        self._there = {"the planner": False, "the model": False}
        self._came: set[str] = set()
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
            self._known.update(planner=dict(self._known.planner))
            self._known.tell(Level.REFUSAL, "no planner is there to take a setting")
            return
        wanted, self._wanted, self._setting = self._wanted, {}, True
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in wanted.items()
        ]
        self._set.call_async(request).add_done_callback(lambda done: self._on_set(wanted, done))

    def _on_set(self, wanted: Mapping[str, Any], done: Any) -> None:
        self._setting, planner = False, dict(self._known.planner)
        for (name, value), result in zip(wanted.items(), done.result().results, strict=True):
            if result.successful:
                planner[name] = value
            else:
                self._known.tell(Level.REFUSAL, f"{name} = {value!r}: {result.reason}")
        self._known.update(planner=planner)  # also where refused: the control goes back
        if self._wanted:
            self._send_settings()

    def load(self, model: str) -> None:
        """Serve another model."""
        if not self._load_model.service_is_ready():
            self._known.tell(Level.REFUSAL, "no model's node is there to load another model")
            return
        self._known.update(loading=model)
        self._known.tell(Level.NOTE, f"loads {model}")

        def on_reply(done: Any) -> None:
            reply = done.result()
            self._known.update(model=reply.model, loading="")
            if reply.error_code == ErrorCode.OK:
                self._known.tell(Level.NOTE, f"the model is {reply.model}")
            else:
                stays = f"{reply.model} stays"
                self._known.tell(Level.REFUSAL, f"load {model}: {reply.error_message}; {stays}")

        self._load_model.call_async(LoadModel.Request(model=model)).add_done_callback(on_reply)

    def learn(self, learns: bool) -> None:
        """Learn from pushes, or not; the learner's own events tell what came of it."""
        if self._set_learner.service_is_ready():
            parameter = Parameter(LEARNS, value=learns).to_parameter_msg()
            self._set_learner.call_async(SetParameters.Request(parameters=[parameter]))

    def _look_for_learner(self) -> None:
        """Ask a learner that is new whether it learns."""
        if not self._get_learner.service_is_ready():
            if self._known.learns is not None:
                self._known.update(learns=None)
        elif self._known.learns is None:
            asked = self._get_learner.call_async(GetParameters.Request(names=[LEARNS]))
            asked.add_done_callback(
                lambda done: self._known.update(learns=done.result().values[0].bool_value)
            )

    def _look_around(self) -> None:
        """Ask who is new what the page should know; tell who comes and goes."""
        clients = (self._get, self._describe)
        for name, client in zip(self._there, clients, strict=True):
            there = bool(client.service_is_ready())
            if there != self._there[name]:
                self._there[name] = there
                self._came.add(name)
                kind = Level.NOTE if there else Level.FAULT
                self._known.tell(kind, f"{name} is {'ready' if there else 'gone'}")
        self._look_what_starts()
        self._look_for_learner()
        if not self._get.service_is_ready():
            self._got = self._setting = False  # a planner that ended answers nothing any more
        elif not self._got:
            self._got = True
            asked = self._get.call_async(GetParameters.Request(names=self._names))
            asked.add_done_callback(self._on_got)
        if not self._describe.service_is_ready():
            self._described = False
            if self._known.loading:  # it ended before it could answer
                self._known.update(loading="")
        elif not self._described:
            self._described = True
            asked = self._describe.call_async(DescribeModel.Request())
            asked.add_done_callback(lambda done: self._known.update(model=done.result().model))

    def _look_what_starts(self) -> None:
        """Say what the graph still waits for, and how far its kernels are compiled."""
        missing = [name for name in self._there if name not in self._came]
        text = describe_compilation() if missing else ""
        if not text and missing and (self._came or self._has_simulator()):  # else a recording
            text = f"waits for {' and '.join(missing)}"
        if text != self._known.starting:
            self._known.update(starting=text)

    def _on_got(self, done: Any) -> None:
        values = map(parameter_value_to_python, done.result().values)
        self._known.update(planner=dict(zip(self._names, values, strict=False)))

    def _on_parameters(self, event: ParameterEvent) -> None:
        if event.node == self._node.resolve_topic_name(LEARNER):
            for one in (*event.new_parameters, *event.changed_parameters):
                if one.name == LEARNS:
                    self._known.update(learns=bool(one.value.bool_value))
        if event.node != self._node.resolve_topic_name(PLANNER):
            return
        changed = {
            one.name: parameter_value_to_python(one.value)
            for one in (*event.new_parameters, *event.changed_parameters)
            if one.name in self._names
        }
        if changed:
            self._known.update(planner={**self._known.planner, **changed})
