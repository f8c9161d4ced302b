"""The episodes of gym-pusht as scenes, and its own measure of success."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from shapely import Polygon

from pusht.block import SHAPE, T
from pusht.world import PushtWorld, friction_of
from sain_core.goal import BodyPose, Goal, Judgement
from sain_core.scene import THETA, Table
from sain_core.shapes.bodies import Bodies
from sain_eval.scenes.families import ScenarioScene

ENOUGH: Final = 0.95  # share of the goal's area: gym-pusht's success_threshold
MAX_PUSHES: Final = 100  # more than there are steps for


@dataclass(frozen=True, eq=False)
class Coverage(Judgement):
    """Judges by the share of the goal's area that the block covers."""

    share: float = 0.0

    @property
    def missed(self) -> tuple[int, ...]:
        """The number of the pose, unless enough of it is covered."""
        return () if self.share > ENOUGH else (0,)


@dataclass(frozen=True)
class CoverageGoal(Goal):
    """A pose that is reached as gym-pusht counts it, whatever the tolerance."""

    def judge(
        self, scene: np.ndarray, start: np.ndarray, bodies: Bodies, table: Table = Table()
    ) -> Coverage:
        """Judge a scene (1, 8)."""
        block, goal = (Polygon(SHAPE.placed(one[0])) for one in (scene, self.placed(scene)))
        plain = super().judge(scene, start, bodies, table)
        return Coverage(**vars(plain), share=block.intersection(goal).area / goal.area)


@dataclass(frozen=True)
class PushtScenario:
    """Draws the scenes that gym-pusht draws."""

    name: str = "gym-pusht"

    def scene(self, seed: int) -> ScenarioScene:
        """Return gym-pusht's episode of a seed, once nothing overlaps."""
        friction, world = friction_of(seed), PushtWorld()
        scene = world.begin(seed)
        x, y, heading = T.scene_of(world.env.goal_pose)[0, : THETA + 1].tolist()
        goal = CoverageGoal((BodyPose(0, x, y, heading),))
        names = (SHAPE.name,)
        return ScenarioScene(
            self.name, seed, scene, friction, names, goal, MAX_PUSHES, success="95 % covered"
        )


SCENARIO: Final = PushtScenario()
