"""The model as a service: single pushes in a batch, or whole sequences in one call."""

from collections.abc import Callable
from dataclasses import asdict
from time import perf_counter
from typing import Any, TypeVar

from rclpy.node import Node

from sain_core.errors import ErrorCode, SainError, error_reply
from sain_core.plugins import load_dynamics
from sain_core.ros import codec
from sain_core.ros.diagnostics import OK, WARN, Diagnostics
from sain_core.ros.node_main import NAMESPACE, node_main
from sain_core.ros.parameters import read_parameters
from sain_interfaces.srv import DescribeModel, PredictResidual, Rollout
from sain_model.serving import ModelServer, ServingConfig

Response = TypeVar("Response", PredictResidual.Response, Rollout.Response)


class ModelNode(Node):
    """Serves one model. An error is an answer like any other, and the service goes on."""

    def __init__(self, **options: Any) -> None:
        """Load the model and run it once."""
        super().__init__("model_node", namespace=NAMESPACE, **options)
        config = read_parameters(self, ServingConfig)
        self.server = ModelServer(load_dynamics(config.model), config)
        self.requests = self.failures = 0
        self.longest = 0.0
        self.diagnostics = Diagnostics(self)
        self.create_service(PredictResidual, "predict_residual", self._on_predict)
        self.create_service(Rollout, "rollout", self._on_rollout)
        self.create_service(DescribeModel, "describe_model", self._on_describe)
        self.get_logger().info(f"ready: serves {config.model}")

    def _on_rollout(self, request: Rollout.Request, response: Rollout.Response) -> Rollout.Response:
        def work() -> None:
            scene, pushes = codec.decode_rollout_request(request)
            past = codec.decode_past(request)
            response.predicted = codec.encode_floats(self.server.rollout(scene, pushes, past))
            response.friction = self.server.friction(past)

        return self._answer(work, response)

    def _on_predict(
        self, request: PredictResidual.Request, response: PredictResidual.Response
    ) -> PredictResidual.Response:
        def work() -> None:
            asked, past = codec.decode_predict_request(request), codec.decode_past(request)
            residual, next_state = self.server.predict(*asked, past)
            response.friction = self.server.friction(past)
            response.residual = codec.encode_floats(residual)
            response.next_state = codec.encode_floats(next_state)

        return self._answer(work, response)

    def _on_describe(
        self, request: DescribeModel.Request, response: DescribeModel.Response
    ) -> DescribeModel.Response:
        for name, value in asdict(self.server.description).items():
            setattr(response, name, value)
        response.max_work = self.server.config.max_work
        response.error_code = int(ErrorCode.OK)
        return response

    def _answer(self, work: Callable[[], None], response: Response) -> Response:
        """Do the work and fill in what every answer has."""
        begun = perf_counter()
        try:
            work()
            response.error_code = int(ErrorCode.OK)
        except SainError as error:
            self.failures += 1
            response.error_code, response.error_message = error_reply(error)
        response.compute_time = perf_counter() - begun
        response.model = self.server.description.model
        response.model_hash = self.server.description.model_hash
        self._report(response)
        return response

    def _report(self, response: Response) -> None:
        self.requests += 1
        self.longest = max(self.longest, response.compute_time)
        well = response.error_code == ErrorCode.OK
        self.diagnostics.set(
            OK if well else WARN,
            "serving" if well else f"refused: {response.error_message}",
            model=response.model,
            requests=self.requests,
            failures=self.failures,
            last_ms=f"{1e3 * response.compute_time:.1f}",
            longest_ms=f"{1e3 * self.longest:.1f}",
        )


def main() -> None:
    """Run the model's service until it is interrupted."""
    node_main(ModelNode, "model_node")
