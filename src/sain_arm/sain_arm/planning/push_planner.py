"""Plans the whole way of the arm for a push, and checks all of it before anything moves.

The way has two parts. The approach leads the tool from where it is to beside the body: along the
table around the bodies, or up, above them and down, whichever is faster, without a rest in between.
The stroke goes straight at a set speed and withdraws a little; the tool stays down, and can be
lifted from there. Both stay in one branch of the inverse kinematics. Several are tried: the arm's
present one, the one of home and some at random. The one with the largest margin to the joints'
limits wins.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy import ndarray

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.kinematics import Kinematics, Tips
from sain_arm.planning.timing import Trajectory, Way
from sain_arm.planning.tool_ways import AWAY, above, around, line, rounded
from sain_arm.robot.arm_model import ArmModel, Contact
from sain_arm.robot.robot import Joints, Robot, Vector
from sain_core.errors import BlockedError, SainError, UnreachableError
from sain_core.feasibility import Stroke
from sain_core.scene import VELOCITY, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Points, Scene

ASIDE: Final = (0.0, 1.2, -1.2)  # [rad], turns at home, one of which hides no body from a camera
CORNERS: Final = (0.05, 0.015)  # [m], sizes of rounded corners, the first one that is possible
ENOUGH: Final = 0.15  # [rad], margin with which the present branch is kept without a search
BRANCHES: Final = 6  # drawn at random
STANDOFF: Final = 0.03  # [m], behind a stroke that is expected, for errors of what is expected
SAME: Final = 0.1  # [rad], within which two ways end in one posture
SLOW: Final = 0.02  # [m/s], [rad/s], of a body that is all but at rest
LEVEL: Final = 1e-4  # [m], within which tips are at one place or height
LOW: Final = 0.005  # [m] above the tip's height in a stroke, up to which it may go along the table
WITHDRAWAL: Final = 0.005  # [m], backwards at the end of a stroke
LEAST_SHARE: Final = 0.98  # of a stroke's speed that the joints must allow


@dataclass(frozen=True, eq=False)
class PushPlan:
    """The motion of the arm for a push, checked.

    Attributes:
        approach: from where the arm is to beside the body.
        stroke: from there through the stroke, and a little backwards.
        pushing: from when to when [s] in `stroke` the tool pushes.
    """

    approach: Trajectory
    stroke: Trajectory
    pushing: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Branch:
    """A stroke in one branch: joints of its ways, and how far they stay from limits [rad]."""

    lower: Joints
    stroke: Joints
    withdraw: Joints
    margin: float


class PushPlanner:
    """Plans pushes for one robot among the bodies of an episode."""

    def __init__(
        self,
        robot: Robot,
        bodies: Bodies | None = None,
        radii: tuple[float, ...] = (),
        config: MotionConfig = MotionConfig(),
    ) -> None:
        """Plan for these bodies with their radii [m]."""
        self.robot, self._stated = robot, config
        self.config = config if bodies is None else config.over(max(bodies.tops))
        self._among = bodies, radii
        self.arm = ArmModel(robot, bodies, radii)
        self.kinematics = Kinematics(self.arm)
        self._outlines: list[Points] = []  # of the bodies that were placed last

    def among(self, bodies: Bodies, radii: tuple[float, ...]) -> "PushPlanner":
        """Return the same for these bodies: itself, if they are those it was made for."""
        if self._among == (bodies, radii):
            return self
        return PushPlanner(self.robot, bodies, radii, self._stated)

    def plan(self, stroke: Stroke, scene: Scene, joints: Vector | None) -> PushPlan:
        """Return the motion for a stroke in a scene (N, 8), from where the arm has joints (J,).

        Without joints the branch of home comes first, so that the same stroke gives the same
        motion, and the approach is the lowering alone: see `approach`.

        Raises:
            UnreachableError: a place, a limit of a joint, or a contact of a link in the way.
            BlockedError: a body in the way.
        """
        self._place(scene)
        self._check_workspace(stroke)
        return self._with_best_branch(stroke, joints)

    def approach(self, plan: PushPlan, joints: Vector, body: int) -> Trajectory:
        """Return the way from joints (J,) to where the stroke of a plan begins, for the same scene.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way.
        """
        return self.travel(joints, plan.stroke.positions[0], beside=body)

    def retreat(self, joints: Vector) -> Trajectory:
        """Return the way straight up from where the arm has joints (J,).

        Raises:
            UnreachableError: there is none.
        """
        return self._moved(self._lifted(joints))

    def home(self, scene: Scene, joints: Vector, turn: float = 0.0) -> Trajectory:
        """Return the way from where the arm has joints (J,), among bodies (N, 8), to its home.

        There the first joint is turned by an angle [rad], as far as it goes.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way.
        """
        self._place(scene)
        return self.travel(joints, self.robot.aside(turn))

    def ahead(self, stroke: Stroke, scene: Scene, joints: Vector) -> Trajectory:
        """Return the way from joints (J,) to behind where a stroke begins, or high above that.

        It touches nothing, and keeps away from the body. While bodies move it is above all of them.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way.
        """
        self._place(scene)
        stroke = stroke.from_further_back(STANDOFF)
        self._check_workspace(stroke)
        end, error = np.array([*stroke.start, self.config.tip_height]), None
        start, moves = self.arm.tip(joints), np.abs(scene[:, VELOCITY]).max() > SLOW
        for ways in list(self._tool_ways(start, end, lowers=False))[-1 if moves else 0 :]:
            for tips in ways:
                try:
                    return self._moved(self._led(joints, tips))
                except (UnreachableError, BlockedError) as failure:
                    error = error or failure
        assert error is not None
        raise error

    def _place(self, scene: Scene) -> None:
        """Take the bodies to be where a scene (N, 8) has them."""
        self.arm.place(scene)
        bodies = self._among[0]
        shapes = () if bodies is None else bodies.shapes
        self._outlines = [shape.placed(state) for shape, state in zip(shapes, scene, strict=False)]

    def _check_workspace(self, stroke: Stroke) -> None:
        """Check that both ends of a stroke are in the workspace box, which is convex."""
        low, high = self.robot.workspace.T
        heights = {"stroke": self.config.tip_height, "travel": self.config.raised}
        for what, height in heights.items():
            for place in (stroke.start, stroke.end):
                tip = np.array([*place, height])
                if not ((tip >= low) & (tip <= high)).all():
                    axis = int(np.argmin((tip >= low) & (tip <= high)))
                    raise UnreachableError(
                        f"the tool would {what} at {'xyz'[axis]} = {tip[axis]:.3f} m; the workspace"
                        f" allows {low[axis]:g} to {high[axis]:g} m"
                    )

    def _with_best_branch(self, stroke: Stroke, joints: Vector | None) -> PushPlan:
        """Return the plan in the present branch if that has margin, else in the best one."""
        plans: list[tuple[float, PushPlan]] = []
        first: SainError | None = None
        for seed in self._seeds(joints):
            try:
                branch = self._branch(stroke, seed)
                if plans and branch.margin <= max(margin for margin, _ in plans):
                    continue
                plans.append((branch.margin, self._timed_plan(stroke, branch, joints)))
            except (UnreachableError, BlockedError) as error:
                first = first or error
                continue
            if branch.margin >= ENOUGH:
                break
        if not plans:
            assert first is not None
            raise first
        return max(plans, key=lambda one: one[0])[1]

    def _seeds(self, joints: Vector | None) -> Iterator[Vector]:
        """Yield joints from which branches are tried, the arm's own first."""
        if joints is not None:
            yield joints
        yield self.robot.home
        random = np.random.default_rng(0)
        span = np.minimum(self.robot.upper - self.robot.lower, 2 * np.pi)
        for _ in range(BRANCHES):
            drawn = self.robot.home + random.uniform(-0.5, 0.5, len(span)) * span
            yield np.clip(drawn, self.robot.lower, self.robot.upper)

    def _branch(self, stroke: Stroke, seed: Vector) -> _Branch:
        """Return the joints of a stroke in the branch that joints (J,) lead to, checked."""
        config = self.config
        start, end = stroke.start, stroke.end
        back = end - min(WITHDRAWAL, stroke.length) * unit(np.asarray(stroke.heading))
        low, high = config.tip_height, config.raised
        points = [
            np.array([*place, height])
            for place, height in (
                (start, high),
                (start, low),
                (end, low),
                (back, low),
                (back, high),
            )
        ]
        ways = [line(*ends) for ends in pairwise(points)]
        tips = np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
        joints = self.kinematics.follow(seed, tips)
        ends = np.cumsum([0, *(len(way) - 1 for way in ways)])
        parts = [joints[first : last + 1] for first, last in pairwise(ends)]
        pushing = self._way(ways[1], parts[1], stroke.speed, config.acceleration)
        share = pushing.speed_share(self.robot)
        if stroke.length > 0.0 and share < LEAST_SHARE:
            raise UnreachableError(
                f"the joints allow {share * stroke.speed:.3f} m/s in this stroke;"
                f" {stroke.speed:g} m/s is asked for"
            )
        pushes = {stroke.body}
        self._check_contacts(parts[0], set(), beside=stroke.body)
        for part in parts[1:]:
            self._check_contacts(part, pushes)
        robot = self.robot
        margin = float(np.minimum(joints - robot.lower, robot.upper - joints).min())
        lower, push, withdraw, _ = parts
        return _Branch(lower, push, withdraw, margin)

    def _timed_plan(self, stroke: Stroke, branch: _Branch, joints: Vector | None) -> PushPlan:
        lower, config = branch.lower, self.config
        if joints is None:
            approach = self._moved(lower)
        else:
            approach = self.travel(joints, lower[-1], stroke.body)
        push, withdraw = (
            self._way(self.arm.tips(part), part, speed, config.acceleration).timed(self.robot)
            for part, speed in (
                (branch.stroke, stroke.speed),
                (branch.withdraw, config.travel_speed),
            )
        )
        return PushPlan(approach, Trajectory.joined([push, withdraw]), (0.0, push.duration))

    def travel(self, start: Vector, end: Vector, beside: int | None = None) -> Trajectory:
        """Return the fastest way found among the bodies from joints (J,) to others.

        Along the table around the bodies, where both ends are low, or up, across and down; if
        neither is possible in one posture, up, straight in joint space, and down.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way, of those that were placed last.
        """
        best: Trajectory | None = None
        error: SainError | None = None
        for ways in self._tool_ways(*self.arm.tips(np.stack([start, end]))):
            for tips in ways:
                least = np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()
                if best is not None and least > best.duration * self.config.travel_speed:
                    break
                try:
                    way = self._moved(self._led(start, tips, end, beside))
                except (UnreachableError, BlockedError) as failure:
                    error = error or failure
                    continue
                best = way if best is None or way.duration < best.duration else best
                break
        return best or self._in_joint_space(start, end, beside, error)

    def _tool_ways(self, start: ndarray, end: ndarray, lowers: bool = True) -> Iterator[list[Tips]]:
        """Yield ways between places (3,) of the tip: of each kind the first possible one counts.

        Those above the bodies end there, unless the tool `lowers` at the end.
        """
        config, robot = self.config, self.robot
        if max(start[2], end[2]) < config.tip_height + LOW:
            limits = robot.workspace[:2]
            corners = around(start[:2], end[:2], self._outlines, robot.tool_radius, limits)
            if corners is not None:
                heights = np.linspace(start[2], end[2], len(corners))[:, None]
                places = np.concatenate([corners, heights], axis=1)
                yield [rounded(places, size) for size in CORNERS]
        end = end if lowers else np.array([*end[:2], config.raised])
        yield [above(start, end, config.raised, robot.base, size) for size in CORNERS]

    def _led(
        self, start: Vector, tips: Tips, end: Vector | None = None, beside: int | None = None
    ) -> Joints:
        """Return joints (T, J) from some to others along a way, or in the same posture; checked.

        As long as the tool is where it was, and straight above, it may touch anything: it may be
        lifted off a body after a stop. A body may be beside it at the ends: straight above them, or
        along the table.
        """
        joints = _begun_at(start, self.kinematics.follow(start, tips))
        rest = np.zeros_like(start) if end is None else end - joints[-1]
        if np.abs(rest).max() >= SAME:  # of the posture, at the same place
            raise UnreachableError("another posture of the arm is needed")
        joints += np.linspace(0.0, 1.0, len(joints))[:, None] * rest
        gone, left = (np.linalg.norm((tips - at)[:, :2], axis=1) for at in tips[[0, -1]])
        above_all = self.config.raised - LEVEL
        lifts = (gone < LEVEL) & (tips[0, 2] < above_all)
        ends = np.minimum(gone, left) < (LEVEL if tips[:, 2].max() >= above_all else AWAY)
        self._check_contacts(joints[lifts], None)
        self._check_contacts(joints[ends & ~lifts], set(), beside)
        self._check_contacts(joints[~ends & ~lifts], set())
        return joints

    def _lifted(self, joints: Vector) -> Joints:
        """Return joints (T, J) straight up to above all bodies from others (J,), in their posture.

        An arm that waits aside is turned, and may be lower than high bodies.
        """
        tip = self.arm.tip(joints)
        if tip[2] >= self.config.raised - LEVEL:
            return np.stack([joints, joints])
        top = np.array([*tip[:2], self.config.raised])
        return _begun_at(joints, self.kinematics.follow(joints, line(tip, top), posture=joints))

    def _in_joint_space(
        self, start: Vector, end: Vector, beside: int | None, error: SainError | None
    ) -> Trajectory:
        """Return the way up, straight in joint space, and down; `error`: why there is no other."""
        lift, lower = self._lifted(start), self._lifted(end)[::-1]
        turn = lower[0] - lift[-1]
        count = max(int(np.ceil(np.abs(turn).max() / 0.05)), 2)
        across = lift[-1] + np.linspace(0.0, 1.0, count + 1)[:, None] * turn
        lowest = self.arm.tips(across)[:, 2].min()
        if lowest < self.config.raised - 0.5 * self.config.clearance:
            raise UnreachableError(
                f"no way above the bodies: {error}; straight in joint space the tip would come"
                f" down to {lowest:.3f} m"
            )
        self._check_contacts(lift, None)
        self._check_contacts(across, set())
        self._check_contacts(lower, set(), beside)
        return Trajectory.joined([self._moved(part) for part in (lift, across, lower)])

    def _check_contacts(
        self, joints: Joints, allowed: set[int] | None, beside: int | None = None
    ) -> None:
        """Check that nothing comes near along joints (T, J) but the tool to the allowed bodies.

        None: the tool may touch anything, as when it lifts off after a stop. The body beside which
        it is lowered may be near, as far as it is not touched.
        """
        for row in joints:
            for contact in self.arm.contacts(row):
                body = contact.body if contact.is_tool else None
                fine = contact.is_tool if allowed is None else body in allowed
                if not fine and not (body is not None and body == beside and contact.gap > 0.0):
                    raise _refusal(contact)

    def _moved(self, joints: Joints) -> Trajectory:
        """Return joints (T, J) over time, out of contact."""
        speed, acceleration = self.config.travel_speed, self.config.travel_acceleration
        return self._way(self.arm.tips(joints), joints, speed, acceleration).timed(self.robot)

    def _way(self, tips: Tips, joints: Joints, speed: float, acceleration: float) -> Way:
        """Return joints (T, J) over the tool's travel, or their own where the tool hardly moves."""
        steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
        turns = np.abs(np.diff(joints, axis=0)).max(axis=1)
        steps = np.maximum(steps, 0.05 * turns)
        keep = np.concatenate([[True], steps > 1e-9])
        travel = np.concatenate([[0.0], np.cumsum(steps)])
        return Way(travel[keep], joints[keep], speed, acceleration)


def _begun_at(start: Vector, joints: Joints) -> Joints:
    """Return a way (T, J) that begins exactly where the joints (J,) are.

    Raises:
        UnreachableError: they are elsewhere, as with a tool that leans.
    """
    rest = start - joints[0]
    if np.abs(rest).max() > SAME:
        raise UnreachableError(
            f"the tool does not point down: a joint is {np.abs(rest).max():.2f} rad from where it"
            " would; bring the arm home"
        )
    return joints + np.linspace(1.0, 0.0, len(joints))[:, None] * rest


def _refusal(contact: Contact) -> SainError:
    link = "the tool" if contact.is_tool else f"link {contact.first}"
    if contact.body is not None:
        return BlockedError(f"{link} would touch body {contact.body} on its way")
    what = "the table" if contact.second == "sain_table" else f"link {contact.second}"
    return UnreachableError(f"{link} would touch {what} on its way")
