"""A model behind the rollout service, to be called from a thread that may wait."""

from copy import copy
from dataclasses import dataclass
from math import inf
from threading import Event
from time import monotonic
from typing import Final, Self

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import (
    CancelledError,
    ErrorCode,
    InvalidInputError,
    ModelUnavailableError,
    SainError,
)
from sain_core.model import Radii
from sain_core.ros import codec
from sain_core.ros.node_main import node_of
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, PushSequences, Scene
from sain_interfaces.srv import Rollout
from sain_mppi.agent.planning import Patience

LOOK: Final = 0.02  # [s] between looks whether an answer is still wanted
MODEL_NODE: Final = "model_node"
SILENCE: Final = 10.0  # [s] after which a model that was starting counts as dead


@dataclass
class Served:
    """Who answered last."""

    model: str = ""


class RemoteRollout:
    """A `RolloutModel` that asks the model's node. Never call it on the executor's thread."""

    def __init__(self, node: Node, timeout_s: float, patience: Patience) -> None:
        self._client = node.create_client(Rollout, "rollout")
        self._name = node.resolve_service_name("rollout")
        self._node_name = node.resolve_service_name(MODEL_NODE)
        self._starting = -inf, ""
        self._timeout_s = timeout_s
        self._served = Served()
        self._bodies: Bodies = PAPER_DISKS
        self._history: PushHistory | None = None
        self._patience = patience
        self._closed = Event()

    @property
    def model(self) -> str:
        """The model that answered last; empty: none has."""
        return self._served.model

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        """Take note of what the model's node does before it serves."""
        for status in message.status:
            if node_of(status) == self._node_name:
                self._starting = monotonic(), status.message

    @property
    def starting(self) -> str:
        """What the model does before it serves for the first time; empty: nothing, or nobody is."""
        said_at, doing = self._starting
        if self.ready or self.model or monotonic() - said_at > SILENCE:
            return ""
        return doing

    @property
    def ready(self) -> bool:
        """Whether a model serves, as far as this node has seen."""
        return bool(self._client.service_is_ready())

    def wait_until_ready(self, timeout_s: float) -> bool:
        """Wait until a model serves, for so long [s]; tell whether one does."""
        return bool(self._client.wait_for_service(timeout_s))

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same model, asked about these bodies."""
        shaped = copy(self)
        shaped._bodies = bodies
        return shaped

    def condition(self, history: PushHistory) -> Self:
        """Return the same model; these earlier pushes of the episode are sent along."""
        conditioned = copy(self)
        conditioned._history = history
        return conditioned

    def close(self) -> None:
        """End the call that waits for an answer, and every later one. For any thread."""
        self._closed.set()

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 5) from one scene (N, 8).

        Raises `ModelUnavailableError`: nobody serves, answers in time, or answers what was asked;
        `CancelledError`: the answer is no longer wanted.
        """
        response = self._ask(self._request(scene, pushes))
        shape = (*pushes.shape[:2], len(scene))
        try:
            return wire.decode_rollout(response, shape)
        except InvalidInputError as error:
            raise ModelUnavailableError(f"the model answered wrongly: {error}") from error

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return how sure the model is of a rollout (K, H, N) [m]; None: it cannot tell.

        The model predicts once more; see `sain_core.model.Model`.

        Raises `ModelUnavailableError`: as `rollout`.
        """
        request = self._request(scene, pushes)
        request.with_regions = True
        response = self._ask(request)
        if not response.regions:
            return None
        try:
            return wire.decode_floats(response.regions, predicted.shape[:3], "regions")
        except InvalidInputError as error:
            raise ModelUnavailableError(f"the model answered wrongly: {error}") from error

    def _request(self, scene: Scene, pushes: PushSequences) -> Rollout.Request:
        samples, horizon, _ = pushes.shape
        request = Rollout.Request(samples=samples, horizon=horizon, disks=len(scene))
        request.scene = codec.encode_floats(scene)
        request.pushes = codec.encode_floats(pushes)
        codec.fill_bodies(request, self._bodies)
        if self._history is not None and self._history.disks == len(scene):
            codec.fill_past(request, self._history)
        return request

    def _ask(self, request: Rollout.Request) -> Rollout.Response:
        if not self.ready:
            raise ModelUnavailableError(f"no model serves {self._name}")
        answered = Event()
        future = self._client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        try:
            self._wait(answered)
        except SainError:
            self._client.remove_pending_request(future)
            raise
        response: Rollout.Response = future.result()
        if response.error_code != ErrorCode.OK:
            raise ModelUnavailableError(f"the model refused: {response.error_message}")
        self._served.model = response.model
        return response

    def _wait(self, answered: Event) -> None:
        timeout, until = self._timeout_s, self._patience.until
        if until is not None:
            timeout = min(timeout, max(until - monotonic(), 0.0))
        end = monotonic() + timeout
        while not answered.wait(min(LOOK, max(end - monotonic(), 0.0))):
            if self._patience.cancelled.is_set() or self._closed.is_set():
                raise CancelledError("the answer is no longer wanted")
            if monotonic() >= end:
                raise ModelUnavailableError(f"the model did not answer within {timeout:.3g} s")
