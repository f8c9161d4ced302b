"""Plans the whole way of the arm for a push, and checks all of it before anything moves.

The way has two parts. The approach lifts the tool from where it is, travels above all bodies and
lowers it beside the body. The stroke goes straight at a set speed, withdraws a little and lifts.
Both stay in one branch of the inverse kinematics. Several are tried: the arm's present one, the one
of home and some at random. The one with the largest margin to the joints' limits wins.
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
from sain_arm.robot.arm_model import ArmModel, Contact
from sain_arm.robot.robot import Joints, Robot, Vector
from sain_core.errors import BlockedError, SainError, UnreachableError
from sain_core.feasibility import Stroke
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene

ASIDE: Final = (0.0, 1.2, -1.2)  # [rad], turns at home, one of which hides no body from a camera
SPACING: Final = 0.01  # [m] between points of a way
ENOUGH: Final = 0.15  # [rad], margin with which the present branch is kept without a search
BRANCHES: Final = 6  # drawn at random
SAME: Final = 0.1  # [rad], within which two ways end in one posture
LEVEL: Final = 1e-4  # [m], within which a tip is as high as one that travels
WITHDRAWAL: Final = 0.005  # [m], backwards at the end of a stroke, before the lift
LEAST_SHARE: Final = 0.98  # of a stroke's speed that the joints must allow


@dataclass(frozen=True, eq=False)
class PushPlan:
    """The motion of the arm for a push, checked.

    Attributes:
        approach: from where the arm is to beside the body.
        stroke: from there through the stroke, up to above its end.
        pushing: from when to when [s] in `stroke` the tool pushes.
        lifts: from when [s] it is lifted, after it has withdrawn a little.
    """

    approach: Trajectory
    stroke: Trajectory
    pushing: tuple[float, float]
    lifts: float


@dataclass(frozen=True, eq=False)
class _Branch:
    """A stroke in one branch: joints of its ways, and how far they stay from limits [rad]."""

    lower: Joints
    stroke: Joints
    withdraw: Joints
    lift: Joints
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
        self.arm.place(scene)
        self._check_workspace(stroke)
        return self._with_best_branch(stroke, joints)

    def approach(self, plan: PushPlan, joints: Vector) -> Trajectory:
        """Return the way from joints (J,) to where the stroke of a plan begins, for the same scene.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way.
        """
        return self._approach(joints, plan.approach.positions)

    def retreat(self, joints: Vector) -> Trajectory:
        """Return the way straight up from where the arm has joints (J,).

        Raises:
            UnreachableError: there is none.
        """
        tip = self.arm.tip(joints)
        if tip[2] >= self.config.raised - LEVEL:
            return self._timed(np.stack([tip, tip]), np.stack([joints, joints]))
        way = self._line(tip, np.array([*tip[:2], self.config.raised]))
        return self._timed(way, _begun_at(joints, self.kinematics.follow(joints, way)))

    def home(self, scene: Scene, joints: Vector, turn: float = 0.0) -> Trajectory:
        """Return the way above bodies (N, 8) from where the arm has joints (J,) to its home.

        There the first joint is turned by an angle [rad], as far as it goes.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way.
        """
        self.arm.place(scene)
        parts = self._lifted(joints)
        start = parts[-1].positions[-1] if parts else joints
        return Trajectory.joined([*parts, self.travel(start, self.robot.aside(turn))])

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
        ways = [self._line(*ends) for ends in pairwise(points)]
        line = np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
        joints = self.kinematics.follow(seed, line)
        ends = np.cumsum([0, *(len(way) - 1 for way in ways)])
        parts = [joints[first : last + 1] for first, last in pairwise(ends)]
        share = self._way(ways[1], parts[1], stroke.speed).speed_share(self.robot)
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
        lower, push, withdraw, lift = parts
        return _Branch(lower, push, withdraw, lift, margin)

    def _timed_plan(self, stroke: Stroke, branch: _Branch, joints: Vector | None) -> PushPlan:
        lower = branch.lower
        approach = self._moved(lower) if joints is None else self._approach(joints, lower)
        parts = [
            self._moved(branch.stroke, stroke.speed),
            self._moved(branch.withdraw),
            self._moved(branch.lift),
        ]
        trajectory = Trajectory.joined(parts)
        pushed, withdrawn, _ = (part.duration for part in parts)
        return PushPlan(approach, trajectory, (0.0, pushed), pushed + withdrawn)

    def _approach(self, joints: Vector, lower: Joints) -> Trajectory:
        """Return the way from joints (J,) to the end of the lowering (T, J): up, across, down."""
        parts = self._lifted(joints)
        start = parts[-1].positions[-1] if parts else joints
        return Trajectory.joined([*parts, self.travel(start, lower[0]), self._moved(lower)])

    def _lifted(self, joints: Vector) -> list[Trajectory]:
        """Return the way straight up to above all bodies from joints (J,); none: it is there."""
        tip = self.arm.tip(joints)
        if tip[2] >= self.config.raised - LEVEL:
            return []
        way = self._line(tip, np.array([*tip[:2], self.config.raised]))
        lift = _begun_at(joints, self.kinematics.follow(joints, way))
        self._check_contacts(lift, None)
        return [self._moved(lift)]

    def travel(self, start: Vector, end: Vector) -> Trajectory:
        """Return the way above all bodies from joints (J,) to others.

        An arc about the base, if it ends in the same posture; else straight in joint space.

        Raises:
            UnreachableError: there is none.
            BlockedError: a body is in the way, of those that were placed last.
        """
        first, last = self.arm.tips(np.stack([start, end]))
        error: SainError
        try:
            joints = _begun_at(start, self.kinematics.follow(start, self._arc(first, last)))
            rest = end - joints[-1]
            if np.abs(rest).max() < SAME:  # of the posture, at the same place
                joints += np.linspace(0.0, 1.0, len(joints))[:, None] * rest
                self._check_contacts(joints, set())
                return self._moved(joints)
            error = UnreachableError("another posture of the arm is needed")
        except (UnreachableError, BlockedError) as failure:
            error = failure
        count = max(int(np.ceil(np.abs(end - start).max() / 0.05)), 2)
        joints = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)
        lowest = self.arm.tips(joints)[:, 2].min()
        if lowest < self.config.raised - 0.5 * self.config.clearance:
            raise UnreachableError(
                f"no way above the bodies: {error}; straight in joint space the tip would come"
                f" down to {lowest:.3f} m"
            )
        self._check_contacts(joints, set())
        return self._moved(joints)

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

    def _line(self, start: ndarray, end: ndarray) -> Tips:
        """Return points (T, 3) on a straight line, `SPACING` apart."""
        count = max(int(np.ceil(np.linalg.norm(end - start) / SPACING)), 2)
        return np.asarray(start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start))

    def _arc(self, start: ndarray, end: ndarray) -> Tips:
        """Return points (T, 3) on a spiral about the base, which comes no nearer than its ends."""
        base = self.robot.base
        near, far = (
            np.array([np.hypot(*(p[:2] - base)), np.arctan2(*(p[:2] - base)[::-1]), p[2]])
            for p in (start, end)
        )
        turn = far - near
        length = np.linalg.norm([turn[0], turn[1] * max(near[0], far[0]), turn[2]])
        count = max(int(np.ceil(length / SPACING)), 2)
        radius, bearing, height = (near + np.linspace(0.0, 1.0, count + 1)[:, None] * turn).T
        x, y = base[0] + radius * np.cos(bearing), base[1] + radius * np.sin(bearing)
        return np.stack([x, y, height], axis=-1)

    def _moved(self, joints: Joints, speed: float | None = None) -> Trajectory:
        return self._way(self.arm.tips(joints), joints, speed).timed(self.robot)

    def _timed(self, tips: Tips, joints: Joints) -> Trajectory:
        return self._way(tips, joints, None).timed(self.robot)

    def _way(self, tips: Tips, joints: Joints, speed: float | None) -> Way:
        """Return joints (T, J) over the tool's travel, or their own where the tool hardly moves."""
        steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
        turns = np.abs(np.diff(joints, axis=0)).max(axis=1)
        steps = np.maximum(steps, 0.05 * turns)
        keep = np.concatenate([[True], steps > 1e-9])
        travel = np.concatenate([[0.0], np.cumsum(steps)])
        speed = self.config.travel_speed if speed is None else speed
        return Way(travel[keep], joints[keep], speed, self.config.acceleration)


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
