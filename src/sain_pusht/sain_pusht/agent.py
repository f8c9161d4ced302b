"""The agent's settings for gym-pusht: the same object as everywhere, in a room with walls."""

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from shapely import Point, contains_xy

from sain_core.config import option
from sain_core.feasibility import Feasibility, Reach
from sain_core.model import RolloutModel
from sain_core.push import PushLimits, tool_start
from sain_core.scene import Table
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Mask, Points, Pushes, Scenes
from sain_mppi.agent.agent import Agent, AgentConfig, planning_agent
from sain_mppi.agent.goal_tracker import GoalTrackerConfig
from sain_mppi.config import CostWeights, PlannerConfig, ProgressConfig
from sain_pusht.block import PIXEL
from sain_pusht.motion import KEEP_OFF, PUSHING, Corners, Room

AGENT_RADIUS: Final = 15 * PIXEL  # [m], gym-pusht's add_circle
WALLS: Final = (7 * PIXEL, 504 * PIXEL)  # [m], their faces: gym-pusht's add_segment


@dataclass(frozen=True)
class SquareReach(Reach):
    """A tool that gets everywhere in a square, in place of an arm's ring."""

    low: float = option(WALLS[0] + AGENT_RADIUS, "smallest x and y", unit="m")
    high: float = option(WALLS[1] - AGENT_RADIUS, "largest x and y", unit="m")

    def contains(self, points: Points) -> Mask:
        """Tell which tool positions (..., 2) are in the square."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=-1))


class ToolPlace:
    """Where the tool is (2,) [m], as the world last noted it; None: anywhere."""

    place: Float[ndarray, "2"] | None = None


@dataclass(frozen=True)
class RoomFeasibility(Feasibility):
    """Pushes of a tool that cannot be lifted: it must get to where they start."""

    reach: SquareReach = SquareReach(inner=0.0, outer=10.0)
    tool: ToolPlace = field(default_factory=ToolPlace, compare=False)

    def mask(self, scenes: Scenes, pushes: Pushes, bodies: Bodies = PAPER_DISKS) -> Mask:
        """Tell which pushes are possible.

        Whether the tool gets to them counts for pushes that all begin from the scene (1, 8) that
        there is now. Where it will be later is not known.
        """
        possible = super().mask(scenes, pushes, bodies)
        one_scene = scenes.ndim == 3 and scenes.strides[0] == 0  # `permitted` repeats it
        if one_scene and len(scenes):
            starts = tool_start(scenes, pushes, self.limits, bodies)
            possible &= self._accessible(bodies.shapes[0].placed(scenes[0, 0]), starts)
        return possible

    def _accessible(self, outline: Corners, places: Points) -> Mask:
        """Tell which places (B, 2) walls and an outline (M, 2) do not shut off from the tool."""
        reach, gap = self.reach, self.limits.tool_radius + KEEP_OFF
        if ((outline - gap >= reach.low) & (outline + gap <= reach.high)).all():
            return np.ones(len(places), dtype=bool)
        parts = Room(reach.low, reach.high).around(outline, gap)
        own = max(parts, key=lambda part: part.area)
        if self.tool.place is not None:
            own = min(parts, key=Point(self.tool.place).distance)
        return np.asarray(contains_xy(own.buffer(KEEP_OFF), *places.T))


LIMITS: Final = PushLimits(tool_radius=AGENT_RADIUS, speed=PUSHING)
FEASIBILITY: Final = RoomFeasibility(
    limits=LIMITS, table=Table(x_min=WALLS[0], x_max=WALLS[1], y_min=WALLS[0], y_max=WALLS[1])
)
PLANNER: Final = PlannerConfig(
    samples=256,
    horizon=2,
    ahead=False,  # time stands still while the agent plans
    speeds=(PUSHING,),
    correction_speed=PUSHING,
    progress=ProgressConfig(give_up_after=0),
    weights=CostWeights(effort=5.0),  # travel costs steps
)


def pusht_agent(
    model: RolloutModel,
    physics: RolloutModel,
    planner: PlannerConfig = PLANNER,
    tool: ToolPlace | None = None,
) -> Agent:
    """Return the agent that plays gym-pusht with a model, and with physics where that fails.

    `tool` is that of the world to play in, which shuts the tool off from some places.
    """
    config = AgentConfig(
        history=False,
        planner=planner,
        goal_tracker=GoalTrackerConfig(max_refusals=30),
        feasibility=replace(FEASIBILITY, tool=tool or ToolPlace()),
    )
    return planning_agent(model, physics, config)
