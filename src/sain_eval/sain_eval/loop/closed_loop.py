"""An episode without ROS: look, decide, push with the simulated arm, look again."""

from dataclasses import dataclass

from sain_core.errors import BlockedError, SainError, UnreachableError
from sain_core.feasibility import Feasibility
from sain_core.push_record import PushRecord
from sain_core.scene import is_settled, target_distance
from sain_core.seeding import generator
from sain_core.types import Scene
from sain_eval.loop.controllers import Controller, Decision
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.scenes.scenarios import ScenarioScene
from sain_mppi.search.goal import goal_reached
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World

MAX_REFUSALS = 10  # in a row: then the controller gives up


@dataclass(frozen=True)
class EpisodeOutcome:
    """What became of an episode."""

    record: EpisodeRecord
    final: Scene  # (N, 8)
    refusals: int
    failure: str  # why it ended short of the tightest tolerance; empty when it did not
    fallen: bool  # a disk left the table


def run_episode(
    case: ScenarioScene,
    controller: Controller,
    tolerance: float,
    world_config: WorldConfig | None = None,
) -> EpisodeOutcome:
    """Play one scene with a controller until the target is within tolerance [m] or time is up."""
    config = world_config or WorldConfig()
    with World(case.parameters(), config) as world:
        scene = world.reset(case.disks)
        return _Episode(case, controller, tolerance, world, config.feasibility).play(scene)


class _Episode:
    def __init__(
        self,
        case: ScenarioScene,
        controller: Controller,
        tolerance: float,
        world: World,
        feasibility: Feasibility,
    ) -> None:
        self.case, self.controller, self.tolerance, self.world = case, controller, tolerance, world
        self.table = feasibility.table
        self.pushes: list[PushRecord] = []
        self.refusals = self.refusals_in_a_row = 0

    def play(self, scene: Scene) -> EpisodeOutcome:
        start, failure = scene, ""
        while not goal_reached(scene, self.case.goal, self.tolerance):
            failure = self._obstacle(scene)
            if failure:
                break
            try:
                decision = self._decide(scene)
                if decision.push is None:
                    failure = "the controller stopped"
                    break
                scene = self._push(scene, decision)
            except SainError as error:
                failure = f"{type(error).__name__}: {error}"
                break
        record = EpisodeRecord(
            self.case.goal, self.tolerance, tuple(self.pushes), start, self.case.shapes
        )
        return EpisodeOutcome(record, scene, self.refusals, failure, self._fallen(scene))

    def _decide(self, scene: Scene) -> Decision:
        """Ask the controller; each try draws from a stream of its own."""
        tries = len(self.pushes) + self.refusals
        random = generator(self.case.seed, "decide", self.case.scenario, tries)
        return self.controller.decide(scene, self.case.goal, random)

    def _push(self, scene: Scene, decision: Decision) -> Scene:
        assert decision.push is not None
        try:
            after = self.world.push(decision.push).after
        except (BlockedError, UnreachableError):
            self.refusals += 1
            self.refusals_in_a_row += 1
            self.controller.refused(decision.push)
            return scene
        self.refusals_in_a_row = 0
        self.controller.observed(scene, decision.push, after)
        self.pushes.append(
            PushRecord(
                decision.push, scene, decision.predicted, None, after, decision.planning_time
            )
        )
        return after

    def _obstacle(self, scene: Scene) -> str:
        """Say why the episode cannot go on, or nothing."""
        if self._fallen(scene):
            return "a disk left the table"
        if not is_settled(scene):
            return "the scene did not settle"
        if len(self.pushes) >= self.case.max_pushes:
            left = 1e3 * float(target_distance(scene, self.case.goal))
            return f"{self.case.max_pushes} pushes left the target {left:.0f} mm from the goal"
        if self.refusals_in_a_row >= MAX_REFUSALS:
            return f"{MAX_REFUSALS} pushes in a row were refused"
        return ""

    def _fallen(self, scene: Scene) -> bool:
        return bool(~self.table.contains(scene[:, :2]).all())
