"""The planner: for each settled scene on the way to a goal, one push."""

from collections.abc import Mapping
from concurrent.futures import Future
from functools import partial
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.guarding.ros.reception import Reception, outcome, shortened
from sain_core.model import as_observed, load_dynamics
from sain_core.policy import POLICY, cameras_of, load_policy
from sain_core.ros.codec import decode_time
from sain_core.ros.node_main import NAMESPACE, OK, WARN, Diagnostics
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_core.ros.push_driver import warn_of_refusal
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_core.ros.worker import Worker
from sain_core.scene import is_settled
from sain_core.wire.bodies import decode_bodies
from sain_interfaces.msg import Bodies, Goal, PushResult, Scene
from sain_mppi.agent.agent import SERVICE, Agent, MppiConfig, planning_agent
from sain_mppi.agent.events import (
    Action,
    Completed,
    Computation,
    EpisodeBegun,
    Event,
    GoalCancelled,
    GoalGiven,
    PushDecision,
    SceneObserved,
    Stop,
    TimePassed,
)
from sain_mppi.agent.planning import Patience
from sain_mppi.agent.policy import PolicyDecider
from sain_mppi.ros.cameras import Cameras
from sain_mppi.ros.goals import GoalHandlers, Goals, task_of
from sain_mppi.ros.plans import Plans
from sain_mppi.ros.remote import RemoteRollout
from sain_mppi.ros.watch import Notes, PeerWatch, event_of

FEW: Final = 4  # scenes, as come while shapes are on their way


class Driver:
    """Hands events to an agent and does what it wants, on the executor's thread."""

    def __init__(
        self, node: Node, agent: Agent, plans: Plans, reception: Reception, watch: PeerWatch
    ) -> None:
        self._agent, self._plans, self._reception, self._watch = agent, plans, reception, watch
        self._worker = Worker(node, "planning")
        self._waiting: tuple[Action, ...] = ()

    def update(self, event: Event) -> None:
        """Take an event; an agent that fails unexpectedly loses its goal."""
        done = outcome(partial(self._agent.update, event))
        error = self._defect(done)
        self._act(done.result() if error is None else self._agent.update(GoalCancelled(error)))

    def _act(self, actions: tuple[Action, ...]) -> None:
        self._waiting += actions
        if not self._watch.ready:
            return
        actions, self._waiting = self._waiting, ()
        for action in actions:
            match action:
                case PushDecision():
                    self._plans.send(action, self._agent.pushes)
                case Stop():
                    self._plans.stop(action, self._agent.pushes)
                case Computation():
                    self._worker.submit(action.run, partial(self._on_done, action))

    def _on_done(self, work: Computation, done: "Future[Event]") -> None:
        error = self._defect(done)
        event = done.result() if error is None else work.failed(error)
        if isinstance(event, Completed):
            self._plans.show(event.decision, self._agent.pushes)
        self.update(event)

    def _defect(self, done: "Future[Any]") -> BaseException | None:
        """Return the error of what never should fail, and leave a trace of it."""
        error = done.exception()
        if error is not None:
            self._reception.log_defect(error)
        return error

    def cancel(self) -> None:
        """Plan no more."""
        self._agent.update(GoalCancelled())

    def close(self) -> None:
        """Wait for the work that is under way."""
        self._worker.close()


class MppiNode(Node):
    """Turns messages into the agent's events."""

    def __init__(self, **options: Any) -> None:
        super().__init__("mppi_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, MppiConfig)
        self.notes, self.reception = Notes(self, config.state_file), Reception(self)
        self.diagnostics = Diagnostics(self, "planning", more=self._figures)
        patience, self.remote = Patience(), None
        if config.dynamics == SERVICE and not config.policy:
            self.remote = RemoteRollout(self, config.model_timeout, patience)
        if config.policy:
            policy = load_policy(config.policy)
            cameras = Cameras(self, self.reception, cameras_of(policy.features))
            self.agent = Agent(
                PolicyDecider(policy, config.policy, config, see=cameras.see), config
            )
        else:
            unknown = config.estimator.unknown
            model = self.remote or as_observed(load_dynamics(config.model), unknown)
            self.agent = planning_agent(model, load_dynamics(config.prior), config, patience)
        self.watch = PeerWatch(self, self.diagnostics, self.remote, self.notes)
        LiveParameters(self, config, self._on_settings)
        self._listen()  # before goals: a pose is for a body of the latest scene
        handlers = GoalHandlers(self._on_goal, self._refuse_goal, self._cancel)
        self.goals = Goals(self, self.reception, handlers, lambda: self.agent.bodies)
        self.plans = Plans(self, self.goals, self.notes, self.watch, self._model_of)
        self.driver = Driver(self, self.agent, self.plans, self.reception, self.watch)
        self._resume()
        self.watch.begin(self._look_again, lambda: self.agent.waits_for_rest)
        self.ready = f"plans with {'a service' if self.remote else config.model}"
        self.ready += f", or else with {config.prior}"
        if config.policy:
            self.ready = f"pushes are those of policy {config.policy}"

    def _figures(self) -> Mapping[str, object]:
        return {**self.reception.figures, **self.agent.decider.figures}

    def _look_again(self) -> None:
        if trouble := self.agent.decider.trouble:
            self.watch.report(WARN, trouble)
        self.driver.update(TimePassed())

    def _listen(self) -> None:
        listen = self.reception.listen
        listen(Scene, "scene", self._on_scene, RELIABLE, self._ignore)
        listen(PushResult, "push_result", self._on_result, QUEUE)
        listen(Bodies, "shapes", self._on_bodies, LATCHED_QUEUE, self._ignore)
        listen(OccupancyGrid, "reach_table", self._on_reach, LATCHED)
        listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, RELIABLE)

    def _resume(self) -> None:
        """Go on where another process was left."""
        notes = self.notes
        self.goals.seen.extend(notes.heard)
        for result in notes.results:
            self.driver.update(event_of(result, self.get_logger()))
        if notes.goal is not None:
            self.driver.update(GoalGiven(task_of(notes.goal), notes.pushes))
            resumed = f"resumes goal {notes.goal.goal_id}, after {notes.pushes} pushes"
            self.get_logger().warning(resumed)

    def _on_settings(self, config: MppiConfig) -> None:
        self.config = config
        self.agent.decider.adjust(config.planner)
        self.get_logger().info("the next plan is made with the parameters as they are now")

    def _on_goal(self, message: Goal) -> None:
        task = task_of(message)
        self.notes.set_goal(message, self.goals.seen)
        self.driver.update(GoalGiven(task))

    def _refuse_goal(self, message: Goal, error: BaseException) -> None:
        self.plans.refuse(message, error, self.agent.pushes)

    def _cancel(self, error: BaseException) -> None:
        self.driver.update(GoalCancelled(error))

    def _model_of(self, decision: PushDecision) -> str:
        if self.config.policy:
            return f"{POLICY}{self.config.policy}"
        if decision.failure is not None:
            return self.config.prior
        return self.config.model if self.remote is None else self.remote.model

    def _on_bodies(self, message: Bodies) -> None:
        time, early = decode_time(message.header.stamp), self.agent.early
        event = EpisodeBegun(message.episode_id, decode_bodies(message), time)
        self.agent.check(event)
        self.driver.update(event)
        if early > FEW:
            self.diagnostics.set(OK, "ready")

    def _on_scene(self, message: Scene) -> None:
        scene, ids = wire.decode_disks(message.disks), (message.episode_id, message.scene_id)
        self.plans.markers.observe(message.episode_id)
        if message.settled and self.config.estimator.is_exact and not is_settled(scene):
            self.get_logger().warning(
                "scenes are called settled while their bodies move: noisy observations need"
                " estimator.noise; no goal counts as reached",
                once=True,
            )
        time, follow = decode_time(message.header.stamp), self.count_publishers("shapes") > 0
        self.driver.update(SceneObserved(scene, *ids, message.settled, time, follow))
        if self.agent.early > FEW:
            text = f"waits for the shapes of episode {message.episode_id}"
            self.diagnostics.set(WARN, text)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.watch.on_diagnostics(message)
        if self.remote is not None:
            self.remote.on_diagnostics(message)

    def _on_reach(self, message: OccupancyGrid) -> None:
        reach = wire.decode_reach(message)
        self.agent.set_reach(reach)
        self.get_logger().info(f"plans pushes in the arm's table of reach, {reach.describe()}")

    def _ignore(self, message: Scene | Bodies, error: BaseException) -> None:
        what = f"the shapes of episode {message.episode_id} are"
        if isinstance(message, Scene):
            what = f"scene {message.scene_id} is"
        self.diagnostics.set(WARN, f"{what} ignored: {shortened(str(error))}")
        self.get_logger().error(f"{what} ignored: {shortened(str(error))}")

    def _on_result(self, message: PushResult) -> None:
        sent = self.agent.pushes
        self.driver.update(event_of(message, self.get_logger()))
        if message.error_code == ErrorCode.OK:
            self.notes.add_result(message, self.agent.pushes)
        elif self.agent.pushes < sent:  # an own one
            text = f"push {message.push_id} refused: {message.error_message}"
            warn_of_refusal(self, message.error_code, text)
            self.notes.count(self.agent.pushes)

    def destroy_node(self) -> None:
        """Stop planning."""
        self.driver.cancel()
        if self.remote is not None:
            self.remote.close()
        self.goals.close()
        self.driver.close()
        super().destroy_node()
