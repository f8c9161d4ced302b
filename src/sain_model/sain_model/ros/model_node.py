"""The model as a service: single pushes in a batch, or whole sequences in one call."""

from collections.abc import Callable
from time import monotonic, perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter

from sain_core import wire
from sain_core.errors import BusyError, ConfigError, error_reply
from sain_core.guarding.ros.reception import LARGE_BYTES, Reception, introspect, shortened
from sain_core.guarding.ros.state_file import StateFile
from sain_core.guarding.untrusted import LONGEST_PATH
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, OK, WARN, Diagnostics, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import LATCHED
from sain_core.ros.worker import Worker
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.shapes.bodies import Bodies as Shapes
from sain_core.wire.bodies import decode_bodies, decode_request_bodies
from sain_interfaces.msg import Bodies
from sain_interfaces.srv import DescribeModel, LoadModel, PredictResidual, Rollout
from sain_model.compute.kernel_store import compile_kernels, describe_progress
from sain_model.serving.service import ServingConfig

if TYPE_CHECKING:
    from sain_model.serving.server import ModelServer

Response = TypeVar("Response", PredictResidual.Response, Rollout.Response)
REPORT_PERIOD = 1.0  # [s]
SAY_PERIOD = 5.0  # [s], of what is done before the node serves
TASK = "predictions"  # of the diagnostics
SERVING = "serving"
MOST_LOADS = 16  # models that wait to be loaded


class ModelNode(Node):
    """Serves one model at a time. An error is an answer like any other, and the service goes on.

    One thread answers requests, one after another; another one loads what is to be served next;
    the executor's takes requests and swaps models. It waits for neither, but when the standard
    parameter service asks for a model: that must be told the outcome in the same breath.
    """

    server: "ModelServer"

    def __init__(self, **options: Any) -> None:
        super().__init__("model_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, ServingConfig)
        self.reception = Reception(self)
        self.diagnostics = Diagnostics(self, TASK, more=lambda: self.reception.figures)
        self.worker, self.loader = Worker(self, "serving"), Worker(self, "loading")
        self.bodies: Shapes = PAPER_DISKS  # of the episode
        self.prepared: ModelServer | None = None  # waits to replace the server
        self.requests = self.failures = 0
        self.refusal = ""  # of the latest request; empty: it was answered
        self.latest = self.longest = 0.0  # [s], from taking a request to answering it
        self._doing, self._said = f"loading {config.model}", -SAY_PERIOD
        self._say()
        self.server = self.worker.wait(self._load, self._say).result()  # no timer runs yet
        self.reception.listen(Bodies, "shapes", self._on_bodies, LATCHED)
        steady_timer(self, REPORT_PERIOD, self._report)
        self._offer(config.service_introspection)
        self.state_file = StateFile(self, config.state_file)
        served = self.state_file.read().get("model", config.model)
        if served != config.model:  # it was changed before a crash
            self.set_parameters([Parameter("model", value=str(served))])
        self.get_logger().info(f"ready: serves {config.model}")

    def _load(self) -> "ModelServer":
        """Compile kernels, and return the first server; on the worker's thread."""
        loading = self._doing

        def report(finished: int, total: int) -> None:
            self._doing = describe_progress(finished, total)

        compile_kernels(report)
        self._doing = loading
        # Numba takes a second to load: a mistake in the parameters is reported before.
        from sain_model.serving.server import load_server

        return load_server(self.config)

    def _say(self) -> None:
        """Say what is done before the node serves to those who wait for it."""
        self.diagnostics.set(WARN, self._doing)
        self.diagnostics.publish()
        if monotonic() - self._said >= SAY_PERIOD:
            self._said = monotonic()
            self.get_logger().info(self._doing)

    def _offer(self, introspection: str) -> None:
        group = ReentrantCallbackGroup()
        for kind, name, callback in (
            (PredictResidual, "predict_residual", self._on_predict),
            (Rollout, "rollout", self._on_rollout),
            (DescribeModel, "describe_model", self._on_describe),
            (LoadModel, "load_model", self._on_load),
        ):
            service = self.reception.serve(kind, name, callback, group, LARGE_BYTES)
            introspect(self, service, introspection)
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.add_post_set_parameters_callback(self._after_set_parameters)

    def _on_bodies(self, message: Bodies) -> None:
        self.bodies = decode_bodies(message)

    async def _on_rollout(
        self, request: Rollout.Request, response: Rollout.Response
    ) -> Rollout.Response:
        def work(server: "ModelServer") -> None:
            server.check_work(request.samples * request.horizon, request.disks)
            scene, pushes = wire.decode_rollout_request(request)
            known = wire.decode_past(request), decode_request_bodies(request, self.bodies)
            predicted = server.rollout(scene, pushes, *known)
            response.predicted = codec.encode_floats(predicted)
            if request.with_regions:
                regions = server.regions(scene, pushes, predicted, *known)
                response.regions = codec.encode_floats(np.empty(0) if regions is None else regions)
            response.friction = server.friction(*known)

        return await self._answer(work, response)

    async def _on_predict(
        self, request: PredictResidual.Request, response: PredictResidual.Response
    ) -> PredictResidual.Response:
        def work(server: "ModelServer") -> None:
            server.check_work(request.batch, request.disks)
            asked = wire.decode_predict_request(request)
            known = wire.decode_past(request), decode_request_bodies(request, self.bodies)
            residual, next_state = server.predict(*asked, history=known[0], bodies=known[1])
            response.friction = server.friction(*known)
            response.residual = codec.encode_floats(residual)
            response.next_state = codec.encode_floats(next_state)

        return await self._answer(work, response)

    def _on_describe(
        self, request: DescribeModel.Request, response: DescribeModel.Response
    ) -> DescribeModel.Response:
        served = self.server
        response.model, response.kind = served.name, served.origin.kind
        response.prior, response.card = served.origin.prior_name, served.origin.card
        response.model_hash = served.origin.model_hash
        response.device = "cpu"  # all that predicts is compiled for it
        response.max_work, response.max_disks = self.config.max_work, self.config.max_disks
        return response

    def _prepare(self, name: str) -> "ModelServer":
        """Return a server of the model of this name, loaded and tried; on the loader's thread."""
        if len(name) > LONGEST_PATH:
            raise ConfigError(f"the model has {len(name)} characters; allowed: {LONGEST_PATH}")
        return self.server.with_model(name, self.bodies)

    async def _on_load(
        self, request: LoadModel.Request, response: LoadModel.Response
    ) -> LoadModel.Response:
        try:
            if self.loader.pending >= MOST_LOADS:
                raise BusyError(f"{MOST_LOADS} models wait to be loaded already; ask again later")
            self.prepared = await self.loader.run(lambda: self._prepare(request.model))
            self.set_parameters([Parameter("model", value=request.model)])
        except Exception as error:
            self._warn_of(error)
            raise
        finally:
            served = self.server
            response.model, response.model_hash = served.name, served.origin.model_hash
        return response

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Load a model that the parameter names, unless `load_model` has done so already."""
        names = [str(one.value) for one in parameters if one.name == "model"]
        if not names or self.prepared is not None:
            return SetParametersResult(successful=True)
        done = self.loader.wait(lambda: self._prepare(names[-1]))
        error = done.exception()
        if error is not None:
            self._warn_of(error)
            return SetParametersResult(successful=False, reason=self.reception.explain(error)[1])
        self.prepared = done.result()
        return SetParametersResult(successful=True)

    def _after_set_parameters(self, parameters: list[Parameter]) -> None:
        if self.prepared is not None:
            self.server, self.prepared = self.prepared, None
            name, digest = self.server.name, self.server.origin.model_hash
            self.state_file.write(model=name)
            self.get_logger().info(f"serves {name} now, {digest[:16]}")
            self._report()

    def _warn_of(self, error: BaseException) -> None:
        going_on = f"goes on serving {self.server.name}"
        self.get_logger().warning(f"{going_on}: {shortened(error_reply(error)[1])}")

    async def _answer(self, work: "Callable[[ModelServer], None]", response: Response) -> Response:
        """Do the work on the thread for it, and fill in what every answer has."""
        taken, waiting, refusal = perf_counter(), self.worker.pending, ""
        try:
            if waiting >= (most := self.config.max_queue):
                raise BusyError(f"{waiting} requests are waiting already; at most {most} may")
            await self.worker.run(lambda: self._compute(work, response))
        except Exception as error:
            refusal = shortened(error_reply(error)[1])
            self.failures += 1
            raise
        finally:
            self.latest = perf_counter() - taken
            self.longest = max(self.longest, self.latest)
            self.requests += 1
            self.refusal = refusal
            if refusal:
                self._report()  # else the timer does: nobody is to wait for it
        return response

    def _compute(self, work: "Callable[[ModelServer], None]", response: Response) -> None:
        """Answer with the model that is served now, whatever is served when it is done."""
        begun, server = perf_counter(), self.server
        response.model, response.model_hash = server.name, server.origin.model_hash
        try:
            work(server)
        finally:
            response.compute_time = perf_counter() - begun

    def _report(self) -> None:
        level, message = (WARN, f"refused: {self.refusal}") if self.refusal else (OK, SERVING)
        self.diagnostics.set(
            level,
            message,
            model=self.server.name,
            model_hash=self.server.origin.model_hash[:16],
            requests=self.requests,
            failures=self.failures,
            queue=self.worker.pending,
            last_ms=f"{1e3 * self.latest:.1f}",
            longest_ms=f"{1e3 * self.longest:.1f}",
        )

    def destroy_node(self) -> None:
        """Finish what was begun."""
        self.loader.close()
        self.worker.close()
        super().destroy_node()
