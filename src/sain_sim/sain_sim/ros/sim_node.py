"""The simulator node: executes pushes, one at a time, and publishes each result."""

from concurrent.futures import Future
from time import monotonic
from typing import Any

from rclpy.node import Node

from sain_core import wire
from sain_core.errors import BusyError, CancelledError, SainError
from sain_core.ros import codec
from sain_core.ros.diagnostics import ERROR, OK, WARN, Diagnostics
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.parameters import read_parameters
from sain_core.ros.peers import Ownership
from sain_core.ros.qos import QUEUE
from sain_core.ros.reception import Reception, emptied, introspect, shortened
from sain_core.ros.steady import steady_timer
from sain_core.ros.worker import Worker
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.srv import ResetScene
from sain_sim.ros.publishing import Publishing
from sain_sim.ros.resumption import LOST_TIME, LeftEpisode, Resumption
from sain_sim.ros.session import Looking, Pacer, Session
from sain_sim.ros.simulator import Pushed, Simulator, SimulatorConfig
from sain_sim.world.workcell import Sample

LOOK_AGAIN = 0.1  # [s] between looks for those who listened before a crash
OWNED = ("scene", "shapes", "push_result", "/clock")
LOOK_FOR_RIVALS = 0.5  # [s] between looks for other publishers of these


class SimNode(Node):
    """Runs the truth world: physics on a worker thread, all else on the executor's."""

    def __init__(self, **options: Any) -> None:
        """Build the worlds and start the first episode."""
        super().__init__("sim_node", namespace=NAMESPACE, **options)
        config = read_parameters(self, SimulatorConfig)
        joined, self.ownership = monotonic(), Ownership(self, OWNED)
        self._closing = False
        self.session = Session()
        self.pacer = Pacer(config.real_time_factor)
        self.worker = Worker(self, "physics")
        self.simulator = self.worker.call(lambda: Simulator(config, self.pacer))
        # Peers have the time to be discovered while the worlds are built.
        self.ownership.refuse(config.peer_wait - (monotonic() - joined))
        self.publishing = Publishing(self, self.simulator, self.session)
        self.looking: Looking | None = None
        if (camera := self.simulator.camera) is not None:
            factor, rate = config.real_time_factor, config.idle_rate
            self.looking = Looking(camera, self.pacer, factor, rate)
        self.reception = Reception(self)
        self.diagnostics = Diagnostics(
            self, "simulation", now=self.publishing.now, more=lambda: self.reception.figures
        )
        self.counts, self.rival = {"executed": 0, "refused": 0}, ""
        self.resumption = Resumption(self, config.state_file)
        self._begin(self.resumption.left)
        self.reception.listen(Push, "push", self._on_push, QUEUE, self._refuse)
        resetting = self.reception.serve(ResetScene, "reset_scene", self._on_reset)
        introspect(self, resetting, config.service_introspection)
        steady_timer(self, 1 / config.idle_rate, self._on_idle)
        steady_timer(self, LOOK_FOR_RIVALS, self._look_for_rivals)
        if self.looking is not None:
            steady_timer(self, self.looking.timer_period, self._on_look)
        self.ready = (
            f"a {config.world} world{self.simulator.within} with {len(self.sample.scene)} disks"
        )

    def _begin(self, left: LeftEpisode | None) -> None:
        """Start the first episode, or go on where another process was left."""
        if left is None:
            self._reset(ResetScene.Request(seed=self.simulator.config.seed))
            return
        last = left.push or left.untold
        known = 0 if last is None else last.push_id
        self.session.go_on_from(left.episode_id, left.scene_id, known)
        self.pacer.go_on_from(left.time + LOST_TIME)
        self.sample = self._place(left.reset)
        self.settled = self.publishing.scene_message(self.sample, moving=False)
        where = f"scene {left.scene_id} of episode {left.episode_id}"
        self.get_logger().warning(f"goes on from {where} after a crash")
        steady_timer(self, LOOK_AGAIN, self._look_for_listeners)

    def _look_for_listeners(self) -> None:
        """Tell all again once they listen again, who may not have heard it before."""
        if not self.resumption.waits or not self.resumption.all_listen():
            return
        if (untold := self.resumption.untold) is not None:
            self.publishing.result(untold)
        self._announce(self.sample)
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
        self.resumption.waits = False
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

    def _keep(self, push: Push | None, untold: PushResult | None = None) -> None:
        """Keep what it takes to go on from here; with the push that is begun, or its result."""
        if not self.resumption.keeps:
            return
        reset = ResetScene.Request(seed=self.begun.seed, world=self.begun.world)
        reset.disks = codec.encode_disks(self.sample.scene)
        reset.shapes, reset.roles = self.begun.shapes, self.begun.roles
        reset.friction = self.simulator.parameters.friction
        ids = self.session.episode_id, self.session.scene_id
        self.resumption.keep(LeftEpisode(reset, *ids, self.pacer.now, push, untold))

    def _on_push(self, message: Push) -> None:
        push = wire.decode_push(message)
        seen = wire.decode_disks(message.disks, "scene of the push") if message.disks else None
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
        self.publishing.state(sample, self.publishing.scene_message(sample, moving=True))
        if self.looking is not None:
            self.looking.watch(sample)
            self.publishing.frames(moving=True)

    def _on_pushed(self, message: Push, done: "Future[Pushed]") -> None:
        error = done.exception()
        if isinstance(error, SainError):
            self.session.finish(executed=False)
            self._keep(None)
            self._refuse(message, error)
            return
        if error is not None:
            self._break_off(message, error)
            return
        pushed = done.result()
        self.session.finish(executed=True)
        self.counts["executed"] += 1
        if self.simulator.camera is not None:
            self.simulator.camera.count_push()
        before = self.settled
        after = self.publishing.scene_message(pushed.sample, moving=False)
        self.sample = pushed.sample
        result = self.publishing.result_message(message, before, after, pushed)
        self._keep(None, result)  # before anybody hears of it: what was told is never taken back
        self.publishing.result(result)
        self._keep(None)
        self._settle(pushed.sample)
        self.publishing.prediction(message, pushed.predicted)

    def _break_off(self, message: Push, error: BaseException) -> None:
        """Answer a push that failed where nothing should: bodies may have moved."""
        self.reception.log_defect(error)
        self.session.finish(executed=True)
        self._settle(self.worker.call(self.simulator.look))
        self._refuse(message, error)

    def _refuse(self, message: Push, error: BaseException) -> None:
        self.counts["refused"] += 1
        message = emptied(message)
        self.get_logger().warning(
            f"push {message.push_id} from {message.source!r} refused: {shortened(str(error))}"
        )
        self.publishing.refusal(message, self.settled, error)

    def _on_look(self) -> None:
        """Take and publish a frame of bodies at rest."""
        if self.looking is not None and not self.session.busy and self.looking.look(self.sample):
            self.publishing.frames(moving=False)

    def _on_idle(self) -> None:
        if self.resumption.waits:
            return
        self._report()
        self.resumption.look_around()
        if not self.session.busy:
            self.pacer.idle()
            self.settled = self.publishing.scene_message(self.sample, moving=False)
            self.publishing.state(self.sample, self.settled)

    def _look_for_rivals(self) -> None:
        self.rival = self.ownership.rival()
        self._report()

    def _report(self) -> None:
        ids = {"episode": self.session.episode_id, "scene": self.session.scene_id}
        figures = {"engine": self.simulator.config.engine, **ids}
        if self.rival:
            self.diagnostics.set(ERROR, self.rival, **figures, **self.counts)
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
        self.ownership.release()
