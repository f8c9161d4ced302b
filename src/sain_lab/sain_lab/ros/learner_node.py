"""The learner of a graph: results come in, and what is in service goes to the model's node.

Nothing on the way from a scene to a push waits for it. Its work runs on a thread of a process of
low priority; when it is dead, the graph goes on with the model that it has.
"""

import os
from concurrent.futures import Future
from time import monotonic
from typing import Any, Final
from uuid import uuid4

import numpy as np
from builtin_interfaces.msg import Time
from jaxtyping import Float, Int
from numpy import ndarray
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ConfigError, ErrorCode, OutputError
from sain_core.guarding import lifetime
from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.guarding.ros.state_file import StateFile
from sain_core.ros.codec import encode_time, header
from sain_core.ros.node_main import (
    ERROR,
    NAMESPACE,
    OK,
    WARN,
    Diagnostics,
    steady_timer,
)
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE
from sain_core.ros.worker import Worker
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.shapes.bodies import Bodies as Shapes
from sain_core.wire.bodies import decode_bodies
from sain_interfaces.msg import Bodies, LearnedCurve, LearnerEvent, Learning, PushResult
from sain_interfaces.srv import LoadModel
from sain_lab.judging.curves import SERVICE, CurveReader, Curves, running
from sain_lab.learner import Learner, Update
from sain_lab.settings import LearnerConfig
from sain_lab.storage.laboratory import PHYSICS, PLANAR, WAITING
from sain_lab.storage.log import Event
from sain_lab.storage.results import Result
from sain_model.compute.threads import one_numba_thread
from sain_model.physics.parameters import BY_NAME

LOOK: Final = 0.5  # [s] between looks for trainings that ended, and for the model's node
AGAIN: Final = 5.0  # [s] after the model's node refused
LAST: Final = 0.5  # [s], for what waits when the graph ends
MOST_EPISODES: Final = 16  # whose bodies are kept
BOTH_ENDS: Final = 2**0.5  # of a way that was observed, over the noise of one scene
PLACES: Final = 60  # of a curve
EVENTS: Final = 20
QUANTILE: Final = 1.96  # standard deviations of a 95 % interval
NAMES: Final = {PHYSICS: "physics", PLANAR: "planar", SERVICE: SERVICE}


def encode_learning(
    curves: Curves, *, stamp: Time, laboratory: str, service: str, waiting: int
) -> Learning:
    """Return the curves and events of a laboratory."""
    return Learning(
        header=header(stamp),
        laboratory=laboratory,
        service=NAMES.get(service, service),
        pushes=curves.pushes,
        waiting=waiting,
        errors=[_error_curve(curves, name) for name in (PLANAR, PHYSICS, SERVICE)],
        parameters=[_parameter_curve(name, rows) for name, rows in curves.parameters.items()],
        events=[encode_event(event) for event in curves.events[-EVENTS:]],
    )


def encode_event(event: Event) -> LearnerEvent:
    """Return an event."""
    stamp = encode_time(round(1e9 * event.time))
    return LearnerEvent(stamp=stamp, kind=event.kind, text=event.text, pushes=event.pushes)


def spaced(count: int) -> Int[ndarray, "C"]:
    """Return up to so many of the numbers 1 to count, evenly by their logarithm, with the last."""
    if not count:
        return np.empty(0, np.int64)
    return np.unique(np.geomspace(1, count, min(PLACES, count)).round().astype(np.int64))


def _error_curve(curves: Curves, name: str) -> LearnedCurve:
    """Return the mean error over the latest pushes [m] with its 95 % interval."""
    at = spaced(curves.pushes)
    mean, half = (1e-3 * some[at - 1] for some in running(curves.errors[name]))
    return _curve(NAMES[name], "m", at, np.stack([mean, mean - half, mean + half], axis=1))


def _parameter_curve(name: str, rows: Float[ndarray, "C 3"]) -> LearnedCurve:
    """Return a parameter with its 95 % interval."""
    rows = rows[spaced(len(rows)) - 1]
    value, half = rows[:, 1], QUANTILE * rows[:, 2]
    if BY_NAME[name].logarithm:
        low, high = value * np.exp(-half), value * np.exp(half)
    else:
        low, high = value - half, value + half
    return _curve(name, BY_NAME[name].unit, rows[:, 0], np.stack([value, low, high], axis=1))


def _curve(name: str, unit: str, at: ndarray, rows: Float[ndarray, "C 3"]) -> LearnedCurve:
    value, low, high = (column.astype(np.float32) for column in rows.T)
    pushes = at.astype(np.uint32)
    return LearnedCurve(name=name, unit=unit, pushes=pushes, value=value, low=low, high=high)


class LearnerNode(Node):
    """Learns from results in one laboratory."""

    patience = 60.0  # [s], for its end: what was delivered is saved

    def __init__(self, **options: Any) -> None:
        super().__init__("learner_node", namespace=NAMESPACE, **options)
        self.config = read_parameters(self, LearnerConfig)
        if not self.config.laboratory:
            raise ConfigError("laboratory is empty; give a name, for example laboratory:=my_table")
        os.nice(self.config.nice)
        self.reception = Reception(self)
        self.diagnostics = Diagnostics(self, "learning", more=lambda: self.reception.figures)
        self.worker = Worker(self, "learning")
        self.learner = Learner.named(self.config.laboratory, self.config.trains)
        self.curves = CurveReader(self.learner.laboratory)
        self._run = self._name_of_run()
        self._bodies: dict[int, Shapes] = {}
        self._again = 0.0  # when it may be asked next [s]
        self._loaded = -1  # generation that the model's node was asked to load
        self._asked: Any = None  # the answer that is waited for
        self._closed = False
        self.topic = self.create_publisher(Learning, "learning", LATCHED)
        self._load_model = self.create_client(LoadModel, "load_model")
        LiveParameters(self, self.config, self._on_settings)
        self.reception.listen(Bodies, "shapes", self._on_bodies, LATCHED_QUEUE)
        steady_timer(self, LOOK, self._look)
        for text in self.learner.laboratory.damage:
            self.get_logger().warning(text)
        waiting = len(self.learner.waiting)
        for _ in range(waiting):
            self.worker.submit(self._learn, self._on_update)
        self._publish()
        path, pushes = self.learner.laboratory.path, self.learner.state.pushes
        self.ready = f"learns in {path}, after {pushes} pushes"
        self.ready += f"; {waiting} more were received before" if waiting else ""
        self._results: Any = None
        # Once the node spins: what is delivered to a node that is interrupted in its start is lost.
        self.create_guard_condition(self._listen).trigger()

    def _listen(self) -> None:
        self._results = self.reception.listen(PushResult, "push_result", self._on_result, QUEUE)

    def _name_of_run(self) -> str:
        """Return the name below which this run's episodes are kept; a restart has the same."""
        file = StateFile(self, self.config.state_file)
        name = str(file.read().get("run", "")) or uuid4().hex[:12]
        file.write(run=name)
        return name

    def _on_settings(self, config: LearnerConfig) -> None:
        self.config = config
        self.get_logger().info(f"{'learns' if config.learns else 'does not learn'} from now on")

    def _on_bodies(self, message: Bodies) -> None:
        self._bodies[message.episode_id] = decode_bodies(message)
        while len(self._bodies) > MOST_EPISODES:
            del self._bodies[next(iter(self._bodies))]

    def _on_result(self, message: PushResult) -> None:
        if not self.config.learns or message.error_code != ErrorCode.OK:
            return
        try:
            self.learner.receive(self._decoded(message))
        except OutputError as error:
            self.get_logger().error(f"a crash now would lose push {message.push_id}: {error}")
        if not self._closed:
            self.worker.submit(self._learn, self._on_update)

    def _learn(self) -> Update:
        """Learn from the result that waits longest; on the worker's thread."""
        with one_numba_thread():
            return self.learner.observe(self.learner.waiting[0])

    def _decoded(self, message: PushResult) -> Result:
        before = wire.decode_disks(message.before.disks, "before")
        noise = None
        if self.config.place_noise > 0.0:
            noise = np.full(len(before), BOTH_ENDS * self.config.place_noise)
        return Result(
            wire.decode_push(message.push),
            before,
            wire.decode_disks(message.after.disks, "after"),
            noise=noise,
            bodies=self._bodies.get(message.episode_id, PAPER_DISKS).fitted(len(before)),
            episode=f"{self._run}/{message.episode_id}",
            time=self.get_clock().now().nanoseconds * 1e-9,
        )

    def _on_update(self, done: "Future[Update]") -> None:
        if (error := done.exception()) is not None:
            text = f"{type(error).__name__}: {shortened(str(error))}"
            self.diagnostics.set(ERROR, f"a push was not learned from: {text}")
            self.get_logger().error(f"a push was not learned from: {text}")
            return
        self._on_events(done.result().events)

    def _on_events(self, events: tuple[Event, ...]) -> None:
        for event in events:
            self.get_logger().info(f"{event.kind}: {event.text}")
        self._publish()

    def _look(self) -> None:
        if not self.worker.pending:
            self.worker.submit(self.learner.poll, self._on_polled)
        self._serve()

    def _on_polled(self, done: "Future[tuple[Event, ...]]") -> None:
        if (error := done.exception()) is not None:
            self.diagnostics.set(ERROR, f"a training was lost: {shortened(str(error))}")
        elif done.result():
            self._on_events(done.result())

    def _serve(self) -> None:
        """Ask the model's node to load what is in service, where that has changed."""
        generation = self.learner.laboratory.manifest.generation
        asked = self._asked is not None and not self._asked.done()
        if asked and not self._load_model.service_is_ready():  # it ended before it could answer
            self._asked, self._loaded = None, -1
        if asked or generation == self._loaded or not self._load_model.service_is_ready():
            return
        if monotonic() < self._again:
            return
        self._loaded = generation
        request = LoadModel.Request(model=self.learner.model_name)
        self._asked = self._load_model.call_async(request)
        self._asked.add_done_callback(self._on_loaded)

    def _on_loaded(self, done: Any) -> None:
        reply = done.result()
        if reply.error_code == ErrorCode.OK:
            return
        self._loaded, self._again = -1, monotonic() + AGAIN  # a busy machine may be too slow once
        text = f"{reply.model} stays in service: {shortened(reply.error_message)}"
        self.diagnostics.set(WARN, text)
        self.get_logger().warning(text)

    def _publish(self) -> None:
        learner = self.learner
        message = encode_learning(
            self.curves.read(),
            stamp=self.get_clock().now().to_msg(),
            laboratory=learner.laboratory.name,
            service=learner.state.judge.service,
            waiting=self.worker.pending,
        )
        self.topic.publish(message)
        figures = {"pushes": learner.state.pushes, "service": message.service}
        self.diagnostics.set(OK, "learning" if self.config.learns else "not learning", **figures)

    def _end(self) -> None:
        """Learn from what still waits, as far as there is time, and close the laboratory."""
        enough, path = monotonic() + LAST, self.learner.laboratory.path
        try:
            while self.learner.waiting and monotonic() < enough:
                self._learn()
            if count := len(self.learner.waiting):
                self.get_logger().warning(
                    f"{count} pushes wait in {path / WAITING}: the next learner begins with them,"
                    f" or `sain lab add {self.config.laboratory}`"
                )
        finally:
            self.learner.close()

    def destroy_node(self) -> None:
        """Take what was delivered, learn from what waits, and close the laboratory."""
        if not self._closed:
            self._closed = True
            lifetime.stopping("saving what it received")
            self.worker.drop()  # its thread would slow down what follows
            results = self._results
            while results and (taken := results.handle.take_message(PushResult, False)):
                results.callback(taken[0])
        self.worker.close(self._end)
        super().destroy_node()
