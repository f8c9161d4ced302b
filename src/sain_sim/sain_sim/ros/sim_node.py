"""The simulator node: a robot whose cell is simulated in this process, with a reset and a clock."""

from concurrent.futures import Future
from time import monotonic
from typing import Any, Final

from sain_arm.planning import push_events as events
from sain_arm.planning.push_events import ArmState, Ended, Ending, Phase
from sain_arm.planning.push_execution import PushExecution
from sain_arm.planning.push_planner import PushPlan
from sain_arm.ros.pushing_node import PushingNode, Wanted
from sain_core import wire
from sain_core.errors import CancelledError, SainError
from sain_core.feasibility import Stroke
from sain_core.ros.node_main import steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.qos import RELIABLE
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_sim.ros.episodes import Episodes
from sain_sim.ros.pacing import Pacer
from sain_sim.ros.publishing import Publishing
from sain_sim.ros.simulator import Measured, Simulator, SimulatorConfig
from sain_sim.world.workcell import Sample

REPORT: Final = 0.5  # [s] between two looks at the state


class SimNode(PushingNode):
    """Runs the truth world: physics on a worker thread, all else on the executor's."""

    def __init__(self, **options: Any) -> None:
        """Build the worlds and start the first episode."""
        super().__init__("sim_node", "physics", **options)
        self._stopped, config = "", read_parameters(self, SimulatorConfig)
        self.pacer = pacer = Pacer(config.real_time_factor)
        self.driver = driver = PushDriver(self, self.begin, config.cell.feasibility, sees=True)
        driver.now = lambda: pacer.now
        driver.owned += ("/clock", "scene", "shapes") if config.scenes else ("/clock",)
        self.simulator = self.worker.call(lambda: Simulator(config, pacer))
        driver.feasibility = feasibility = self.simulator.config.cell.feasibility
        self.execution = PushExecution(config.cell.motion, feasibility.limits.clearance)
        self.publishing = publishing = Publishing(self, self.simulator, driver)
        self.episodes = Episodes(publishing, self.worker)
        self._joints = publishing.sample.joint_positions
        self.take_reach(feasibility.reach)
        if not config.scenes:
            driver.reception.listen(SceneMessage, "scene", self._on_scene, RELIABLE)
        steady_timer(self, 1 / config.images.rate / (config.real_time_factor or 1), self._on_image)
        steady_timer(self, 1 / config.idle_rate, self._on_idle)
        steady_timer(self, REPORT, publishing.report)
        if (timer := self.simulator.camera_timer) is not None:
            steady_timer(self, timer.timer_period, publishing.frame)
        world = f"a {config.world} world{self.simulator.within}"
        self.ready = f"{world} with {len(publishing.sample.scene)} disks"

    def begin(self, push: Push, stroke: Stroke) -> None:
        """Take a push; it is kept, so that it is answered also after a crash."""
        self.pacer.idle()
        self.episodes.begin(push)
        self.publishing.state_world()
        self._push, self._pushed = push, (self.publishing.sample, PushResult())
        self._joints = self.publishing.sample.joint_positions
        super().begin(push, stroke)

    def arm_state(self) -> ArmState:
        """Return the state of the arm, which follows each goal to its end."""
        now = monotonic()
        return ArmState(now, self.pacer.now, self._joints, stamp=now, changed=now, still=True)

    def plan(self, wanted: Wanted) -> PushPlan:
        """Plan a push."""
        assert isinstance(wanted, events.PlanPush)  # the arm leaves each stroke by itself
        return self.simulator.world.plan(wanted.stroke)

    def send(self, goal: events.Send) -> None:
        """Have the arm follow a goal; the world shows the approach with the stroke."""
        if self.phase is Phase.APPROACHES:
            self._end(goal)
        else:
            self.worker.submit(self._carry_out, lambda done: self._on_pushed(goal, done))

    def cancel(self, why: str) -> None:
        """Break off the push that is under way; the world is left as it is then."""
        self._stopped = why

    def _carry_out(self) -> Measured:
        """Make the push that is under way, on the worker's thread."""
        push, disks = wire.decode_push(self._push), self._push.disks
        seen = wire.decode_disks(disks) if disks else None
        return self.simulator.push(push, self._on_sample, seen)

    def _on_sample(self, sample: Sample) -> None:
        """Publish a moving world, on the worker's thread: the executor publishes no states then."""
        if self._stopped:
            raise CancelledError(self._stopped)
        self.publishing.moving(sample)

    def _on_pushed(self, goal: events.Send, done: "Future[Measured]") -> None:
        error = done.exception()
        if error is None:
            self._pushed = done.result()
            self._end(goal)
            return
        if not isinstance(error, SainError):  # where nothing should fail: bodies may have moved
            self.driver.reception.log_defect(error)
            self.driver.session.finish(executed=True)
            self.publishing.take(self.worker.call(self.simulator.observe))
            self.publishing.settle()
        self.update(events.SendRefused(error))

    def _end(self, goal: events.Send) -> None:
        self._joints = goal.trajectory.positions[-1]
        self.update(events.GoalEnded(Ending(Ended.SUCCEEDED)))

    def answer_executed(self, doubt: CancelledError | None) -> None:
        """Answer with the world as it is after the push."""
        self.publishing.sample, measured = self._pushed
        super().answer_executed(doubt)
        self.driver.conclude(self.publishing.scene_message(), measured)

    def _on_scene(self, message: SceneMessage) -> None:
        """Take up the ids of the scenes that somebody else publishes: pushes have these."""
        session, ids = self.driver.session, (message.episode_id, message.scene_id)
        if not session.busy and ids != (session.episode_id, session.scene_id):
            session.go_on_from(*ids)
            self.publishing.take(self.publishing.sample)

    def _on_image(self) -> None:
        if self.episodes.rests:
            self.publishing.look(self.worker)

    def _on_idle(self) -> None:
        self.episodes.look_around()
        if self.episodes.rests:
            self.pacer.idle()
            self.publishing.take(self.publishing.sample)
            self.publishing.state()

    def destroy_node(self) -> None:
        """Stop a push that is under way, and close the worlds."""
        self.cancel("the simulator is being stopped")
        self.worker.close(last=self.simulator.close)
        super().destroy_node()
        self.driver.release_namespace()
