"""The simulator node: executes pushes, one at a time, and publishes each result."""

from concurrent.futures import Future
from time import monotonic
from typing import Any

from rclpy.node import Node

from sain_core import wire
from sain_core.errors import BusyError, CancelledError, ErrorCode, SainError, error_reply
from sain_core.ros import codec
from sain_core.ros.diagnostics import ERROR, OK, WARN, Diagnostics
from sain_core.ros.introspection import introspect
from sain_core.ros.listeners import Return, listeners
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.parameters import read_parameters
from sain_core.ros.peers import publisher_count, refuse_peers
from sain_core.ros.qos import RELIABLE
from sain_core.ros.state_file import StateFile
from sain_core.ros.steady import steady_timer
from sain_core.ros.worker import Worker
from sain_interfaces.msg import Push
from sain_interfaces.srv import ResetScene
from sain_sim.node.looking import Looking
from sain_sim.node.pacing import Pacer
from sain_sim.node.session import Session
from sain_sim.node.simulator import Pushed, Simulator, SimulatorConfig
from sain_sim.ros.publishing import Publishing
from sain_sim.ros.resumption import LOST_TIME, Moment
from sain_sim.world.outcome import Sample

PUSH_RESULT = "push_result"
LOOK_AGAIN = 0.1  # [s] between looks for those who listened before a crash


class SimNode(Node):
    """Runs the truth world: physics on a worker thread, all else on the executor's."""

    def __init__(self, **options: Any) -> None:
        """Build the worlds and start the first episode."""
        super().__init__("sim_node", namespace=NAMESPACE, **options)
        config = read_parameters(self, SimulatorConfig)
        joined = monotonic()
        self._closing = False
        self.session = Session()
        self.pacer = Pacer(config.real_time_factor)
        self.worker = Worker(self, "physics")
        self.simulator = self.worker.call(lambda: Simulator(config, self.pacer))
        if config.peer_wait > 0.0:  # peers have the time to be discovered while worlds are built
            refuse_peers(self, ("scene", "/clock"), config.peer_wait - (monotonic() - joined))
        self.publishing = Publishing(self, self.simulator, self.session)
        self.looking: Looking | None = None
        if (camera := self.simulator.camera) is not None:
            factor, rate = config.real_time_factor, config.idle_rate
            self.looking = Looking(camera, self.pacer, factor, rate)
        self.diagnostics = Diagnostics(self, "simulation", now=self.publishing.now)
        self.counts = {"executed": 0, "refused": 0}
        self.state_file = StateFile(self, config.state_file)
        self.back: Return | None = None  # of those who listened before a crash
        self.lost: Push | None = None  # with it
        self.listeners: tuple[str, ...] = ()
        self._begin(Moment.read(self.state_file))
        self.create_subscription(Push, "push", self._on_push, RELIABLE)
        resetting = self.create_service(ResetScene, "reset_scene", self._on_reset)
        introspect(self, resetting, config.service_introspection)
        steady_timer(self, 1 / config.idle_rate, self._on_idle)
        if self.looking is not None:
            steady_timer(self, self.looking.timer_period, self._on_look)
        self.ready = (
            f"a {config.world} world{self.simulator.within} with {len(self.sample.scene)} disks"
        )

    def _begin(self, left: Moment | None) -> None:
        """Start the first episode, or go on where another process was left."""
        if left is None:
            self._reset(ResetScene.Request(seed=self.simulator.config.seed))
            return
        lost = left.push
        self.session.go_on_from(left.episode_id, left.scene_id, 0 if lost is None else lost.push_id)
        self.pacer.go_on_from(left.time + LOST_TIME)
        self.sample = self._place(left.reset)
        self.settled = self.publishing.scene_message(self.sample, moving=False)
        where = f"scene {left.scene_id} of episode {left.episode_id}"
        self.get_logger().warning(f"goes on from {where}, as {self.state_file} has it")
        self.back = Return(self, PUSH_RESULT, left.listeners)
        self.lost = lost
        steady_timer(self, LOOK_AGAIN, self._look_for_listeners)

    def _look_for_listeners(self) -> None:
        """Tell all again once they listen again, who may not have heard it before."""
        if self.back is None or not self.back.complete():
            return
        self._announce(self.sample)
        if self.lost is not None:
            text = f"push {self.lost.push_id} ended when the simulator crashed; it moved nothing"
            self._refuse(self.lost, CancelledError(text))

    def _on_reset(
        self, request: ResetScene.Request, response: ResetScene.Response
    ) -> ResetScene.Response:
        try:
            self._reset(request)
            response.error_code = ErrorCode.OK
        except SainError as error:
            self.get_logger().warning(f"reset refused: {error}")
            response.error_code, response.error_message = error_reply(error)
        response.scene = self.settled
        return response

    def _reset(self, request: ResetScene.Request) -> None:
        if self.session.busy:
            raise BusyError(f"push {self.session.busy_with} is under way; reset when it has ended")
        sample = self._place(request)
        self.session.begin_episode()
        self._announce(sample)

    def _place(self, request: ResetScene.Request) -> Sample:
        """Bring the world to where a request has it."""
        scene = wire.decode_disks(request.disks) if request.disks else None
        shapes, roles = tuple(request.shapes), tuple(request.roles)
        self.pacer.idle()
        sample = self.worker.call(
            lambda: self.simulator.reset(
                request.seed, request.world, scene, shapes, request.friction, roles
            )
        )
        self.begun = request
        return sample

    def _announce(self, sample: Sample) -> None:
        """Publish all about an episode from its start."""
        self.back = None
        self.publishing.shapes()
        self.publishing.world(self.begun.seed, self.begun.world)
        self.sample = sample
        self._keep(None)
        self._settle(sample)

    def _settle(self, sample: Sample) -> None:
        """Publish a settled scene, which the next push must name."""
        if self.looking is not None:
            self.looking.renew()
        self.sample = sample
        self.settled = self.publishing.scene_message(sample, moving=False)
        self.publishing.state(sample, self.settled)

    def _keep(self, push: Push | None) -> None:
        """Keep what it takes to go on from here; with the push that is begun."""
        reset = ResetScene.Request(seed=self.begun.seed, world=self.begun.world)
        parameters = self.simulator.parameters
        reset.disks = codec.encode_disks(self.sample.scene)
        reset.shapes, reset.roles = list(self.begun.shapes), list(self.begun.roles)
        reset.friction = parameters.friction
        ids = self.session.episode_id, self.session.scene_id
        Moment(reset, *ids, self.pacer.now, push, self.listeners).write(self.state_file)

    def _on_push(self, message: Push) -> None:
        try:
            push = wire.decode_push(message)
            seen = wire.decode_disks(message.disks, "scene of the push") if message.disks else None
            if self.back is not None:
                raise BusyError("the simulator goes on after a crash; send the push anew later")
            self.session.admit(message.push_id, message.episode_id, message.scene_id)
        except SainError as error:
            self._refuse(message, error)
            return
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
        self.publishing.state(sample, self.publishing.scene_message(sample, moving=True))
        if self.looking is not None:
            self.looking.watch(sample)
            self.publishing.frames(moving=True)

    def _on_pushed(self, message: Push, done: "Future[Pushed]") -> None:
        try:
            pushed = done.result()
        except SainError as error:
            self.session.finish(executed=False)
            self._keep(None)
            self._refuse(message, error)
            return
        self.session.finish(executed=True)
        self.counts["executed"] += 1
        if self.simulator.camera is not None:
            self.simulator.camera.count_push()
        before = self.settled
        after = self.publishing.scene_message(pushed.sample, moving=False)
        self.sample = pushed.sample
        self._keep(None)  # before anybody hears of it: what was told is never taken back
        self.publishing.result(message, before, after, pushed)
        self._settle(pushed.sample)
        self.publishing.prediction(message, pushed.predicted)

    def _refuse(self, message: Push, error: SainError) -> None:
        self.counts["refused"] += 1
        self.get_logger().warning(
            f"push {message.push_id} from {message.source!r} refused: {error}"
        )
        self.publishing.refusal(message, self.settled, error)

    def _on_look(self) -> None:
        """Take and publish a frame of bodies at rest."""
        if self.looking is not None and not self.session.busy and self.looking.look(self.sample):
            self.publishing.frames(moving=False)

    def _on_idle(self) -> None:
        if self.back is not None:
            return
        self._report()
        if self.state_file:
            self.listeners = tuple(sorted(listeners(self, PUSH_RESULT)))
        if not self.session.busy:
            self.pacer.idle()
            self.settled = self.publishing.scene_message(self.sample, moving=False)
            self.publishing.state(self.sample, self.settled)

    def _report(self) -> None:
        ids = {"episode": self.session.episode_id, "scene": self.session.scene_id}
        figures = {"engine": self.simulator.config.engine, **ids}
        if (simulators := publisher_count(self, "scene")) > 1:
            message = f"{simulators} simulators publish the same scene; stop all but one"
            self.diagnostics.set(ERROR, message, **figures, **self.counts)
        elif not self.session.busy and not self.settled.settled:
            message = "the disks do not come to rest; reset the scene"
            self.diagnostics.set(WARN, message, **figures, **self.counts)
        else:
            self.diagnostics.set(OK, "simulating", **figures, **self.counts)

    def destroy_node(self) -> None:
        """Stop a push that is under way, and close the worlds."""
        self._closing = True
        self.worker.close(last=self.simulator.close)
        super().destroy_node()
