"""The planner: for each settled scene on the way to a goal, one push."""

from concurrent.futures import Future
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ErrorCode, SainError
from sain_core.model import as_observed, load_dynamics
from sain_core.ros import codec
from sain_core.ros.diagnostics import ERROR, OK, WARN, Diagnostics
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_core.ros.peers import Ownership, Return, listeners
from sain_core.ros.qos import LATCHED_QUEUE, QUEUE, RELIABLE
from sain_core.ros.reception import Reception, outcome, shortened
from sain_core.ros.steady import steady_timer
from sain_core.ros.worker import Worker
from sain_core.scene import is_settled
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_core.shapes.received import check_unchanged, decode_bodies
from sain_interfaces.msg import Bodies, Goal, Plan, Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_mppi.agent.agent import SERVICE, MppiConfig, planning_agent
from sain_mppi.agent.decision import PushDecision, Stop, Task
from sain_mppi.agent.events import (
    Action,
    Completed,
    Computation,
    EpisodeBegun,
    Event,
    GoalCancelled,
    GoalGiven,
    PushEnded,
    PushExecuted,
    SceneSeen,
    TimePassed,
)
from sain_mppi.agent.fallback import Patience
from sain_mppi.ros.goals import Aims, Goals
from sain_mppi.ros.markers import PlanMarkers
from sain_mppi.ros.plan_message import (
    plan_of_bad_goal,
    plan_of_decision,
    plan_of_stop,
    push_message,
    summary,
)
from sain_mppi.ros.remote import RemoteRollout
from sain_mppi.ros.resumption import Notes

MOST_EARLY = 500  # scenes that are kept until their shapes are known
FEW = 4  # of them, as come while shapes are on their way
MOST_SHAPES = 16  # episodes whose shapes are kept until their scenes come
LOOK_AROUND = 1.0  # [s] between looks for who listens
LOOK_FOR_RIVALS = 0.5  # [s] between looks for other planners
LOOK_AGAIN = 0.1  # [s] between looks for what no message tells of
NO_MODEL = "no model is ready yet: plans use physics without learning"


class MppiNode(Node):
    """Turns messages into the agent's events and publishes its actions.

    The agent's work runs on a worker thread.
    """

    def __init__(self, **options: Any) -> None:
        """Get the agent ready, and wait for a scene and a goal."""
        super().__init__("mppi_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, MppiConfig)
        self.ownership = Ownership(self, ("plan",))  # people and players send pushes, too
        in_process = config.dynamics != SERVICE
        patience = Patience()
        self.remote = None if in_process else RemoteRollout(self, config.model_timeout, patience)
        model = self.remote or as_observed(load_dynamics(config.model), config.estimator.unknown)
        physics = load_dynamics(config.prior)
        self.agent = planning_agent(model, physics, config, patience)
        LiveParameters(self, config, self._on_settings)
        self.worker = Worker(self, "planning")
        self.actions: list[Action] = []  # of the agent, that wait for listeners or for the model
        self.plan = Plan()  # of the push that was sent last
        self.notes = Notes(self, config.state_file)
        self.plan_ids = count(self.notes.plans + 1)
        self.episode = 0  # of the latest scene
        self.shapes: dict[int, CoreBodies] = {}  # of this episode and others, by episode
        self.shapes_stamp = Time()  # of the latest
        self.early: list[SceneMessage] = []  # of an episode whose shapes are not known yet
        self._offer()
        self._resume()
        self.starting, self.rival = True, ""
        self.diagnostics.set(WARN, NO_MODEL)
        steady_timer(self, LOOK_AGAIN, self._look_again)
        steady_timer(self, LOOK_FOR_RIVALS, self._look_for_rivals)
        if config.state_file:
            steady_timer(self, LOOK_AROUND, self._look_around)
        where = "a service" if self.remote else config.model
        self.ready = f"plans with {where}, or else with {config.prior}"

    def _offer(self) -> None:
        self.push_publisher = self.create_publisher(Push, "push", RELIABLE)
        self.plan_publisher = self.create_publisher(Plan, "plan", RELIABLE)
        self.plan_markers = PlanMarkers(self, "plan_markers")
        self.reception = reception = Reception(self)
        self.diagnostics = Diagnostics(self, "planning", more=lambda: reception.figures)
        reception.listen(SceneMessage, "scene", self._on_scene, RELIABLE, self._ignore_scene)
        reception.listen(PushResult, "push_result", self._on_result, QUEUE)
        reception.listen(Bodies, "shapes", self._on_bodies, LATCHED_QUEUE, self._ignore_bodies)
        if self.remote is not None:
            told = self.remote.on_diagnostics
            reception.listen(DiagnosticArray, "/diagnostics", told, RELIABLE)
        self.goals = Goals(
            self,
            reception,
            Aims(self._on_goal, self._refuse_goal, self._cancel),
            lambda: self.shapes.get(self.episode, PAPER_DISKS),
        )

    def _resume(self) -> None:
        """Go on where another process was left."""
        notes = self.notes
        self.goals.seen.extend(notes.heard)
        self.back = Return(self, "plan", notes.listeners, anyone=notes.goal is not None)
        for result in notes.results:
            self._learn(result)
        if notes.goal is not None:
            self._update(GoalGiven(_task(notes.goal), notes.pushes))
            self.get_logger().warning(
                f"goes on with goal {notes.goal.goal_id}, after {notes.pushes} pushes"
            )

    def _look_again(self) -> None:
        """Look for the model at the start, and go on where a message that was waited for fails."""
        if self.starting and (self.remote is None or self.remote.ready):
            self.starting = False
            self.diagnostics.set(OK, "ready")
        elif self.starting and self.remote is not None:
            doing = self.remote.starting
            self.diagnostics.set(WARN, f"waits for the model: {doing}" if doing else NO_MODEL)
        self._update(TimePassed())

    def _look_around(self) -> None:
        if self.back.complete():
            self.notes.heard_by(listeners(self, "plan"))

    def _look_for_rivals(self) -> None:
        before, self.rival = self.rival, self.ownership.rival()
        if self.rival:
            self.diagnostics.set(ERROR, self.rival)
        elif before:
            self.diagnostics.set(OK, "ready")

    def _on_settings(self, config: MppiConfig) -> None:
        self.config = config
        self.agent.decider.adjust(config.planner)
        self.get_logger().info("the next plan is made with the parameters as they are now")

    def _on_goal(self, message: Goal) -> None:
        task = _task(message)
        self.notes.aimed(message, self.goals.seen)
        self._update(GoalGiven(task))

    def _refuse_goal(self, message: Goal, error: BaseException) -> None:
        self._publish(plan_of_bad_goal(message, error))

    def _cancel(self, error: SainError) -> None:
        self._update(GoalCancelled(error))

    def _on_bodies(self, message: Bodies) -> None:
        bodies, episode = decode_bodies(message), message.episode_id
        again = self.shapes_stamp == message.header.stamp != Time()  # for somebody who came late
        self.shapes_stamp = message.header.stamp
        if episode == self.episode and episode in self.shapes:
            check_unchanged(self.shapes[episode], bodies)
            # They are told at the start of an episode, and of a process that goes on with it.
            if not again:
                self._begin_episode(codec.decode_time(message.header.stamp))
        else:  # whose scenes come, if any: not every publisher is the simulator
            self.shapes.pop(episode, None)
            for other in [one for one in self.shapes if one != self.episode][: 1 - MOST_SHAPES]:
                del self.shapes[other]
            self.shapes[episode] = bodies
            if episode == self.episode:
                self._begin_episode()
        early, self.early = self.early, []
        if len(early) > FEW:
            self.diagnostics.set(OK, "ready")
        for scene in early:
            self._on_scene(scene)

    def _begin_episode(self, time: float = 0.0) -> None:
        self._update(EpisodeBegun(self.episode, self.shapes[self.episode], time))

    def _ignore_bodies(self, message: Bodies, error: BaseException) -> None:
        text = f"the shapes of episode {message.episode_id} are ignored: {shortened(str(error))}"
        self.get_logger().error(text)
        self.diagnostics.set(WARN, text)

    def _waits_for_shapes(self, episode_id: int) -> bool:
        """Tell whether a simulator sends shapes, and those of an episode have not come yet.

        Topics overtake each other. Recordings from before there were shapes have none to wait for.
        """
        return episode_id not in self.shapes and self.count_publishers("shapes") > 0

    def _on_scene(self, message: SceneMessage) -> None:
        scene = wire.decode_disks(message.disks)
        self.plan_markers.see(message.episode_id)
        if self._waits_for_shapes(message.episode_id):
            same = [early for early in self.early if early.episode_id == message.episode_id]
            self.early = [*same[-MOST_EARLY:], message]
            if len(self.early) > FEW:
                self.diagnostics.set(WARN, f"waits for the shapes of episode {message.episode_id}")
            return
        if self.episode != message.episode_id:
            self.episode = message.episode_id
            if self.episode in self.shapes:
                self._begin_episode()
        if message.settled and self.config.estimator.is_exact and not is_settled(scene):
            self.get_logger().warning(
                "scenes are called settled while their bodies move: noisy observations need"
                " estimator.noise; no goal counts as reached",
                once=True,
            )
        ids, observed = (message.episode_id, message.scene_id), message.header.stamp
        self._update(SceneSeen(scene, *ids, message.settled, codec.decode_time(observed)))

    def _ignore_scene(self, message: SceneMessage, error: BaseException) -> None:
        text = f"scene {message.scene_id} is ignored: {shortened(str(error))}"
        self.diagnostics.set(WARN, text)

    def _on_result(self, message: PushResult) -> None:
        if message.error_code == ErrorCode.OK:
            self._learn(message)
            self.notes.learned(message, self.agent.pushes)
            return
        sent = self.agent.pushes
        self._end_push(message)
        if self.agent.pushes < sent:  # an own one
            self.get_logger().warning(f"push {message.push_id} refused: {message.error_message}")
            self.notes.counted(self.agent.pushes)

    def _learn(self, message: PushResult) -> None:
        try:
            before, push, after = wire.decode_result(message)
        except SainError as error:
            self.get_logger().warning(f"nothing is learned of push {message.push_id}: {error}")
            self._end_push(message)
            return
        ids, ended = (message.push_id, message.episode_id), message.header.stamp
        self._update(PushExecuted(*ids, before, push, after, codec.decode_time(ended)))

    def _end_push(self, message: PushResult) -> None:
        ended = codec.decode_time(message.header.stamp)
        self._update(PushEnded(message.push_id, message.error_code, ended))

    def _update(self, event: Event) -> None:
        if self._failed(done := outcome(partial(self.agent.update, event))):
            error = done.exception()
            assert error is not None
            self.actions += self.agent.update(GoalCancelled(error))
        else:
            self.actions += done.result()
        self._act()

    def _act(self) -> None:
        """Do what the agent wants; the first plan waits for a model that is about to serve."""
        if not self.back.complete() or (self.remote is not None and self.remote.starting):
            return
        actions, self.actions = self.actions, []
        for action in actions:
            match action:
                case PushDecision():
                    self._send(action)
                case Stop():
                    self._publish(plan_of_stop(action))
                case Computation():
                    self.worker.submit(action.run, partial(self._on_done, action))

    def _on_done(self, work: Computation, done: "Future[Event]") -> None:
        error = done.exception() if self._failed(done) else None
        event = done.result() if error is None else work.failed(error)
        if isinstance(event, Completed):
            self._show(event.decision)
        self._update(event)

    def _send(self, decision: PushDecision) -> None:
        stamp, source = self.get_clock().now().to_msg(), self.get_fully_qualified_name()
        self.push_publisher.publish(push_message(decision, stamp, source))
        self.notes.counted(self.agent.pushes)
        model = self.config.model if self.remote is None else self.remote.model
        model = model if decision.failure is None else self.config.prior
        self.plan = plan_of_decision(decision, model)

    def _show(self, decision: PushDecision) -> None:
        """Publish a plan whose push is on its way, with all that is known of it."""
        regions = None if decision.plan is None else decision.plan.regions
        self.plan.regions = codec.encode_floats(np.empty(0) if regions is None else regions)
        self._publish(self.plan)
        self.plan_markers.show(decision, self.get_clock().now().to_msg())

    def _failed(self, done: "Future[Any]") -> bool:
        """Tell whether work failed that never should, and leave a trace of it."""
        error = done.exception()
        if error is not None:
            self.reception.log_defect(error)
        return error is not None

    def _publish(self, plan: Plan) -> None:
        plan.plan_id = next(self.plan_ids)
        plan.header = codec.header(self.get_clock().now().to_msg())
        self.plan_publisher.publish(plan)
        self.notes.planned(plan)  # killed before this, the next process publishes it again
        self.goals.follow(plan, self.agent.pushes)
        self.starting = False  # what became of a plan says more
        well = plan.error_code in (ErrorCode.OK, ErrorCode.CANCELLED)
        self.diagnostics.set(OK if well else WARN, **summary(plan), pushes=self.agent.pushes)

    def destroy_node(self) -> None:
        """Stop planning."""
        self.agent.update(GoalCancelled())
        if self.remote is not None:
            self.remote.close()
        self.goals.close()
        self.worker.close()
        super().destroy_node()
        self.ownership.release()


def _task(message: Goal) -> Task:
    """Return the task that a message gives; raise `SainError` if its goal cannot be one."""
    ids = message.goal_id, message.episode_id
    return Task(*ids, wire.decode_goal(message), message.max_pushes)
