"""What viewers draw of a plan: goal, expected ways, what else was tried, where the push may lead.

RViz and Foxglove show them side by side with the simulator's disks.
"""

from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from jaxtyping import Float
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.push import pushed_bodies
from sain_core.ros.markers import MarkerBoard, body_marker, line_marker, make_marker, make_pose
from sain_core.scene import DISK_HEIGHT, X, Y
from sain_core.types import Scene
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.algorithms.result import Shown

LINE_WIDTH: Final = 0.006  # [m]
GOAL_HEIGHT: Final = 0.002  # [m]
THIN_LINE: Final = 0.0015  # [m]
GOAL_COLOUR: Final = rgba(PALETTE.goal, 0.8)

GHOST_ALPHA: Final = 0.25
REGION_COLOUR: Final = (0.96, 0.76, 0.20, 0.35)
CHEAP: Final = np.array([0.20, 0.60, 0.35, 0.6])
EXPENSIVE: Final = np.array([0.75, 0.25, 0.20, 0.15])

State = Float[np.ndarray, "8"]


class PlanMarkers:
    """The topic of a plan's markers."""

    def __init__(self, node: Node, topic: str) -> None:
        """Publish on this topic, at first nothing."""
        self._board = MarkerBoard(node, topic)
        self._episode: int | None = None

    def show(self, decision: PushDecision, stamp: Time) -> None:
        """Show a plan."""
        self._episode = decision.job.observed.episode_id
        self._board.show(plan_markers(decision, stamp))

    def observe(self, episode_id: int) -> None:
        """Clear what is shown once another episode has begun."""
        if self._episode not in (None, episode_id):
            self._episode = None
            self._board.show(())


def plan_markers(decision: PushDecision, stamp: Time) -> list[Marker]:
    """Return the goal and, for the bodies that matter, the way that the plan expects."""
    job, result = decision.job, decision.plan
    markers = goal_markers(job, stamp)
    if result is None:
        return markers
    scene, bodies = job.problem.scene, job.problem.bodies
    markers += _others(scene, result.others, job.problem.goal.wanted[0], stamp)
    for body in shown_bodies(decision):
        colour, after = rgba(PALETTE.disk(body), 0.9), result.predicted[0, body]
        way = result.way(scene, body)
        markers.append(line_marker("path", body, way, DISK_HEIGHT, LINE_WIDTH, colour, stamp))
        ghost = (*colour[:3], GHOST_ALPHA)
        shape = bodies.shapes[body]
        markers.append(body_marker("ghost", body, shape, after.tolist(), ghost, stamp))
        radius = 0.0 if result.regions is None else float(result.regions[0, body])
        if radius > 0.0:
            markers.append(_region(body, after, radius, stamp))
    return markers


def shown_bodies(decision: PushDecision) -> tuple[int, ...]:
    """Return the bodies whose ways are drawn: those pushed or with a pose."""
    pushes = decision.push[None] if decision.plan is None else decision.plan.pushes
    return tuple(sorted({*pushed_bodies(pushes).tolist(), *decision.job.problem.goal.wanted}))


def goal_markers(job: PlanJob, stamp: Time) -> list[Marker]:
    """Return the goal: outlines in their poses.

    A pose without a heading is a flat disk as wide as the tolerance.
    """
    goal, scene, bodies = job.problem.goal, job.problem.scene, job.problem.bodies
    markers = []
    for pose in goal.poses:
        if pose.heading is None:
            markers.append(_goal_disk(pose.body, pose.x, pose.y, pose.tolerance, stamp))
            continue
        state = goal.placed(scene)[pose.body]
        outline = bodies.shapes[pose.body].placed(state)
        ring = np.concatenate([outline, outline[:1]])
        markers.append(
            line_marker("goal", pose.body, ring, GOAL_HEIGHT, LINE_WIDTH, GOAL_COLOUR, stamp)
        )
    return markers


def _goal_disk(number: int, x: float, y: float, tolerance: float, stamp: Time) -> Marker:
    marker = make_marker("goal", number, Marker.CYLINDER, GOAL_COLOUR, stamp)
    marker.pose = make_pose(x, y, GOAL_HEIGHT / 2)
    marker.scale = Vector3(x=2 * tolerance, y=2 * tolerance, z=GOAL_HEIGHT)
    return marker


def _others(scene: Scene, others: Shown, body: int, stamp: Time) -> list[Marker]:
    """Return where other sequences lead a body, from green (cheap) to a pale red (expensive)."""
    count, horizon = others.predicted.shape[:2]
    if not count:
        return []
    marker = make_marker("others", 0, Marker.LINE_LIST, (0.0, 0.0, 0.0, 1.0), stamp)
    marker.scale = Vector3(x=THIN_LINE)
    ways = others.ways(scene, body)
    legs = np.stack([ways[:, :-1], ways[:, 1:]], axis=2)  # (R, H, 2, 2), from and to
    marker.points = [Point(x=x, y=y, z=DISK_HEIGHT) for x, y in legs.reshape(-1, 2).tolist()]
    rank = np.linspace(0.0, 1.0, count)[:, None]
    for red, green, blue, alpha in ((1.0 - rank) * CHEAP + rank * EXPENSIVE).tolist():
        colour = ColorRGBA(r=red, g=green, b=blue, a=alpha)
        marker.colors.extend([colour] * (2 * horizon))
    return [marker]


def _region(disk: int, state: State, radius: float, stamp: Time) -> Marker:
    """Return the region that should hold a disk's centre after the push."""
    marker = make_marker("region", disk, Marker.CYLINDER, REGION_COLOUR, stamp)
    x, y = state[[X, Y]].tolist()
    marker.pose = make_pose(x, y, DISK_HEIGHT + LINE_WIDTH)
    marker.scale = Vector3(x=2 * radius, y=2 * radius, z=GOAL_HEIGHT)
    return marker
