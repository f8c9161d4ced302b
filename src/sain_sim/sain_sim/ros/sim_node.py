"""The simulator node: executes pushes, one at a time, and publishes each result."""

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.node import Node

from sain_core import wire
from sain_core.camera.image_camera import Shot
from sain_core.errors import BusyError, CancelledError, SainError
from sain_core.guarding.ros.ownership import find_second_publisher, lock_namespace
from sain_core.guarding.ros.reception import Reception, introspect, shortened
from sain_core.guarding.session import Session
from sain_core.ros.node_main import NAMESPACE, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import QUEUE, RELIABLE
from sain_core.ros.worker import Worker
from sain_core.types import Scene
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene
from sain_sim.ros.pacing import Pacer
from sain_sim.ros.publishing import Publishing
from sain_sim.ros.resumption import Resumption
from sain_sim.ros.simulator import Pushed, Simulator, SimulatorConfig
from sain_sim.world.workcell import Sample

LOOK_AGAIN = 0.1  # [s] between looks for those who listened before a crash
OWNED = ("push_result", "/clock")
SCENES = ("scene", "shapes")  # owned by a node that sees the bodies, if there is one
REPORT = 0.5  # [s] between looks for other publishers of these


class SimNode(Node):
    """Runs the truth world: physics on a worker thread, all else on the executor's."""

    def __init__(self, **options: Any) -> None:
        """Build the worlds and start the first episode."""
        super().__init__("sim_node", namespace=NAMESPACE, **options)
        config = read_parameters(self, SimulatorConfig)
        self._release = lock_namespace(self)
        self._owned = (*SCENES, *OWNED) if config.scenes else OWNED
        self._closing, self.counts = False, {"executed": 0, "refused": 0}
        self.session, self.pacer = Session(), Pacer(config.real_time_factor)
        self.worker = Worker(self, "physics")
        self.simulator = self.worker.call(lambda: Simulator(config, self.pacer))
        self.reception = reception = Reception(self)
        self.publishing = Publishing(self, self.simulator, self.session, reception)
        self.resumption = Resumption(self, config.state_file, self.session, self.pacer)
        self._begin()
        reception.listen(Push, "push", self._on_push, QUEUE, self._refuse)
        resetting = reception.serve(ResetScene, "reset_scene", self._on_reset)
        introspect(self, resetting, config.service_introspection)
        if not config.scenes:
            reception.listen(SceneMessage, "scene", self._on_scene, RELIABLE)
        steady_timer(self, 1 / config.images.rate / (config.real_time_factor or 1), self._on_image)
        steady_timer(self, 1 / config.idle_rate, self._on_idle)
        steady_timer(self, REPORT, self._report)
        if (timer := self.simulator.camera_timer) is not None:
            steady_timer(self, timer.timer_period, self._on_frame)
        self.ready = f"a {config.world} world{self.simulator.within} with {self.simulator.what}"

    def _begin(self) -> None:
        """Start the first episode, or go on where another process was left."""
        if (request := self.resumption.resume()) is None:
            self._reset(ResetScene.Request(seed=self.simulator.config.seed))
        else:
            self.publishing.take(self._place(request))
            steady_timer(self, LOOK_AGAIN, self._look_for_listeners)

    def _look_for_listeners(self) -> None:
        """Publish all again, once they listen again, that somebody may not have received."""
        if not self.resumption.waits or not self.resumption.all_listen():
            return
        if (unsent := self.resumption.unsent) is not None:
            self.publishing.result(unsent)
        self._announce(self.publishing.sample)
        if (lost := self.resumption.lost) is not None:
            text = f"push {lost.push_id} ended when the simulator crashed; it moved nothing"
            self._refuse(lost, CancelledError(text))

    def _on_reset(
        self, request: ResetScene.Request, response: ResetScene.Response
    ) -> ResetScene.Response:
        try:
            self._reset(request)
        except SainError as error:
            self.get_logger().warning(f"reset refused: {shortened(str(error))}")
            raise
        finally:
            response.scene = self.publishing.settled
        return response

    def _reset(self, request: ResetScene.Request) -> None:
        self.session.check_idle()
        sample = self._place(request)
        self.session.begin_episode()
        self._announce(sample)

    def _place(self, request: ResetScene.Request) -> Sample:
        """Bring the world to where a request has it."""
        scene = _bodies(request.disks, "scene of the reset")
        shapes, roles = tuple(request.shapes), tuple(request.roles)
        given = request.seed, request.world, scene, shapes, request.friction, roles
        self.pacer.idle()
        sample = self.worker.call(lambda: self.simulator.reset(*given))
        self.begun = request
        return sample

    def _announce(self, sample: Sample) -> None:
        """Publish all about an episode from its start."""
        self.resumption.waits = False
        self.publishing.episode(self.begun)
        self.publishing.take(sample)
        self._keep()
        self.publishing.settle(sample)

    def _keep(self, push: Push | None = None, unsent: PushResult | None = None) -> None:
        """Keep what it takes to go on from here; with the push that is begun, or its result."""
        scene, friction = self.publishing.sample.scene, self.simulator.parameters.friction
        self.resumption.keep(self.begun, scene, friction, push, unsent)

    def _on_push(self, message: Push) -> None:
        push = wire.decode_push(message)
        seen = _bodies(message.disks, "scene of the push")
        if self.resumption.waits:
            raise BusyError("the simulator goes on after a crash; send the push anew later")
        self.session.admit(message.push_id, message.episode_id, message.scene_id)
        self.pacer.idle()
        self._keep(message)
        self.worker.submit(
            lambda: self.simulator.push(push, self._on_sample, seen),
            lambda done: self._on_pushed(message, done),
        )

    def _on_sample(self, sample: Sample) -> None:
        """Publish a moving world, on the worker's thread: the executor publishes no states then."""
        if self._closing:
            raise CancelledError("the simulator is being stopped")
        self.publishing.moving(sample)

    def _on_pushed(self, message: Push, done: "Future[Pushed]") -> None:
        error = done.exception()
        self.session.finish(executed=not isinstance(error, SainError))
        if isinstance(error, SainError):
            self._keep()
            self._refuse(message, error)
        elif error is not None:  # where nothing should fail: bodies may have moved
            self.reception.log_defect(error)
            self.publishing.settle(self.worker.call(self.simulator.observe))
            self._refuse(message, error)
        else:
            pushed = done.result()
            self.counts["executed"] += 1
            result = self.publishing.executed(message, pushed)
            self._keep(None, result)  # before it is published: a result is never taken back
            self.publishing.result(result)
            self._keep()
            self.publishing.settle(pushed.sample)

    def _refuse(self, message: Push, error: BaseException) -> None:
        self.counts["refused"] += 1
        self.get_logger().warning(
            f"push {message.push_id} from {message.source!r} refused: {shortened(str(error))}"
        )
        self.publishing.refusal(message, error)

    def _on_frame(self) -> None:
        """Take and publish a frame of bodies at rest."""
        if not self.session.busy:
            self.publishing.frame()

    def _on_scene(self, message: SceneMessage) -> None:
        """Take up the ids of the scenes that somebody else publishes: pushes have these."""
        ids = message.episode_id, message.scene_id
        if not self.session.busy and ids != (self.session.episode_id, self.session.scene_id):
            self.session.go_on_from(*ids)
            self.publishing.take(self.publishing.sample)

    def _on_image(self) -> None:
        """Take images of bodies at rest, if somebody wants any; time goes on."""
        busy = self.session.busy or self.worker.pending or self.resumption.waits
        if busy or not self.publishing.images.wanted:
            return
        config = self.simulator.config
        if config.real_time_factor > 0.0:
            self.pacer.idle()
        else:
            self.pacer.skip(1.0 / config.images.rate)
        self.publishing.tick()
        sample, stamp = self.publishing.sample, self.publishing.now()
        self.worker.submit(
            lambda: self.simulator.shoot(sample), lambda done: self._on_shot(done, stamp)
        )

    def _on_shot(self, done: "Future[Shot]", stamp: Time) -> None:
        error = done.exception()
        if isinstance(error, SainError):
            text = f"no images: {shortened(str(error))}"
            self.get_logger().error(text, throttle_duration_sec=10.0)
        else:
            self.publishing.shot(done.result(), stamp)

    def _on_idle(self) -> None:
        if self.resumption.waits:
            return
        self.resumption.look_around()
        if not self.session.busy:
            self.pacer.idle()
            self.publishing.take(self.publishing.sample)
            self.publishing.state()

    def _report(self) -> None:
        self.publishing.report(find_second_publisher(self, self._owned), self.counts)

    def destroy_node(self) -> None:
        """Stop a push that is under way, and close the worlds."""
        self._closing = True
        self.worker.close(last=self.simulator.close)
        super().destroy_node()
        self._release()


def _bodies(disks: Sequence[Any], name: str) -> Scene | None:
    return wire.check_bodies(wire.decode_disks(disks, name), name) if disks else None
