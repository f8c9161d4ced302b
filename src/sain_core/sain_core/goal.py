"""What bodies should come to: poses, and the one judge of how far a scene is from them."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError, OffTableError, OutOfRangeError
from sain_core.scene import POSE, POSITION, RADIUS, TARGET, THETA, Table, X, is_settled
from sain_core.shapes.bodies import Bodies, overlap
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import outline_of
from sain_core.shapes.solids import DISK
from sain_core.types import Angles, Points, Scene, Scenes

Errors = Float[ndarray, "*B P"]  # of P poses

TOLERANCE: Final = 0.02
"""[m], of a pose that states none."""
TURN_PER_METRE: Final = 5.0
"""[rad/m], of a heading that states none: half of the distance at the rim of a body of 0.1 m."""
KEEP_TOLERANCE: Final = 0.005  # [m], of a goal that states none
MOST_SHARED: Final = 1e-3  # [m], by which the bodies of two goals may overlap
MOST_TOLERANCE: Final = 1.0  # [m], less than a table is wide
MOST_TURN: Final = 5.0  # [rad]; any heading is nearer than pi
OBSERVED: Final = ("wanted", "x", "y", "theta_wanted", "theta")  # of a body, by a policy


@dataclass(frozen=True)
class BodyPose:
    """Where one body should come to rest."""

    body: int  # its row in the scene
    x: float  # [m]
    y: float  # [m]
    heading: float | None = None  # [rad], modulo the symmetry of its shape; None: any
    tolerance: float = TOLERANCE  # [m], of the place
    heading_tolerance: float = TURN_PER_METRE * TOLERANCE  # [rad]

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("x", "y", "heading"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                raise InvalidInputError(
                    f"{name} of the goal of body {self.body} is {value}; it must be finite"
                )
        check_tolerance(self.tolerance, f"tolerance of body {self.body}")
        turn = f"heading_tolerance of body {self.body}"
        check_tolerance(self.heading_tolerance, turn, MOST_TURN, "rad")


@dataclass(frozen=True)
class Goal:
    """Poses of one or several bodies, and bodies that may not be moved."""

    poses: tuple[BodyPose, ...]  # one or more, at most one for each body
    keep: tuple[int, ...] = ()  # bodies that must stay where they are when the goal is given
    keep_tolerance: float = KEEP_TOLERANCE  # [m], by which these may be moved

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not self.poses:
            raise InvalidInputError("the goal has no poses; give one or more")
        check_tolerance(self.keep_tolerance, "keep_tolerance")

    @classmethod
    def place(cls, x: float, y: float, tolerance: float = TOLERANCE, body: int = TARGET) -> Self:
        """Return the goal to bring one body to a place [m], with any heading."""
        return cls((BodyPose(body, float(x), float(y), tolerance=tolerance),))

    @property
    def wanted(self) -> tuple[int, ...]:
        """The bodies that have a pose."""
        return tuple(pose.body for pose in self.poses)

    @property
    def places(self) -> Points:
        """Where they should come to (P, 2) [m]."""
        return np.array([(pose.x, pose.y) for pose in self.poses])

    @property
    def has_heading(self) -> bool:
        """Whether a pose has a heading."""
        return any(pose.heading is not None for pose in self.poses)

    @property
    def tolerance(self) -> float:
        """The largest tolerance of a place [m]."""
        return max(pose.tolerance for pose in self.poses)

    @property
    def heading_tolerance(self) -> float:
        """The largest tolerance of a heading [rad]; 0: no pose has one."""
        turns = (pose.heading_tolerance for pose in self.poses if pose.heading is not None)
        return max(turns, default=0.0)

    @property
    def is_place(self) -> bool:
        """Whether all it asks for is that the target comes to a place."""
        return self.wanted == (TARGET,) and not self.has_heading and not self.keep

    def within(self, tolerance: float, heading_tolerance: float) -> Self:
        """Return the goal with other tolerances [m] and [rad] of all poses."""
        poses = (
            replace(pose, tolerance=tolerance, heading_tolerance=heading_tolerance)
            for pose in self.poses
        )
        return replace(self, poses=tuple(poses))

    def fitted(self, count: int) -> Self:
        """Return the goal in a scene of so many bodies: a single one stands for the target."""
        if count > 1 or not self.is_place:
            return self
        return replace(self, poses=(replace(self.poses[0], body=0),))

    def with_pose(self, body: int, x: float, y: float, heading: float) -> Self:
        """Return the goal with another pose [m, rad] of one body; a free heading stays free."""
        poses = list(self.poses)
        for place, pose in enumerate(poses):
            if pose.body == body:
                turned = None if pose.heading is None else heading
                poses[place] = replace(pose, x=x, y=y, heading=turned)
        return replace(self, poses=tuple(poses))

    @property
    def numbers(self) -> np.ndarray:
        """All numbers of the goal in one array; NaN for a heading that is free."""
        poses = [(p.body, p.x, p.y, np.nan if p.heading is None else p.heading) for p in self.poses]
        return np.array([*np.ravel(poses), *self.keep], dtype=np.float64)

    def observed(self, count: int) -> Float[ndarray, "N 5"]:
        """Return the goal of each of the first so many bodies, as `OBSERVED`: finite."""
        asked = np.full((count, 3), np.nan)
        for pose in (one for one in self.poses if one.body < count):
            asked[pose.body] = pose.x, pose.y, np.nan if pose.heading is None else pose.heading
        return observed_poses(asked)

    def check(self, scene: Scene, bodies: Bodies, table: Table) -> None:
        """Check that these bodies can have these poses, on a table."""
        self.check_bodies(bodies)
        self.check_places(table)
        self.check_room(scene, bodies)

    def check_bodies(self, bodies: Bodies) -> None:
        """Check that these bodies can have poses, and be kept, whatever the places are."""
        for pose in self.poses:
            self._check_pose(pose, bodies)
        for body in self.keep:
            if not 0 <= body < len(bodies):
                raise InvalidInputError(
                    f"body {body} is to be kept; the scene has bodies 0 to {len(bodies) - 1}"
                )
            if body in self.wanted:
                raise InvalidInputError(f"body {body} is to be kept and to be moved to a pose")

    def check_places(self, table: Table) -> None:
        """Check that all places are on the table; raise `OffTableError`."""
        for pose in self.poses:
            place = np.array([pose.x, pose.y])
            if not table.contains(place):
                meant = 1e-3 * place
                hint = f"; in mm? {meant[0]:g} {meant[1]:g} m" if table.contains(meant) else ""
                raise OffTableError(
                    f"the goal ({pose.x:.3f}, {pose.y:.3f}) m of body {pose.body} is off the table;"
                    f" it covers {table.describe()}{hint}"
                )

    def _check_pose(self, pose: BodyPose, bodies: Bodies) -> None:
        if not 0 <= pose.body < len(bodies):
            raise InvalidInputError(
                f"a goal is given for body {pose.body}; the scene has bodies 0 to {len(bodies) - 1}"
            )
        shape = bodies.shapes[pose.body]
        if (count := self.wanted.count(pose.body)) > 1:
            raise InvalidInputError(f"body {pose.body} has {count} goals; allowed: 1")
        if pose.heading is not None and shape.is_round:
            raise InvalidInputError(
                f"the goal of body {pose.body} has heading {pose.heading:.3f} rad; it is a disk and"
                " has none: leave the heading out"
            )
        if pose.body in bodies.fixed:
            raise InvalidInputError(f"body {pose.body} is fixed; it cannot be moved to a goal")

    def check_room(self, scene: Scene, bodies: Bodies, most: float = MOST_SHARED) -> None:
        """Check that no two bodies have to overlap by more than `most` [m].

        These are the bodies whose places are given, by a pose or as they are kept or fixed.

        A body may have any heading where none is given. It then covers its inscribed circle for
        sure, and no more is asked for.
        """
        placed, shapes = self.placed(scene), list(bodies.shapes)
        for pose in self.poses:
            if pose.heading is None and not shapes[pose.body].is_round:
                placed[pose.body, RADIUS] *= outline_of(shapes[pose.body]).inscribed
                shapes[pose.body] = get_shape(DISK)
        least = replace(bodies, shapes=tuple(shapes))
        given = self.wanted
        names = dict.fromkeys(given, "goal of body") | dict.fromkeys(self.keep, "kept body")
        names |= dict.fromkeys(bodies.fixed, "fixed body")
        for index, body in enumerate(given):
            for other in (*given[:index], *self.keep, *bodies.fixed):
                deep = overlap(placed, least, body, other)
                if deep > most:
                    raise InvalidInputError(
                        f"the goal of body {body} overlaps {names[other]} {other} by"
                        f" {1e3 * deep:.1f} mm"
                    )

    def placed(self, scene: Scene) -> Scene:
        """Return a scene (N, 8) with the bodies at their goals, all others where they are."""
        placed = scene.copy()
        for pose in self.poses:
            placed[pose.body, POSITION] = pose.x, pose.y
            if pose.heading is not None:
                placed[pose.body, THETA] = pose.heading
        return placed

    def errors(self, scenes: Scenes, bodies: Bodies) -> tuple[Errors, Errors]:
        """Return distances [m] and signed turns [rad] (..., P) of bodies to their poses.

        A turn is 0 where any heading will do. NaN: the scenes have no such body.
        """
        distances = np.full((*scenes.shape[:-2], len(self.poses)), np.nan)
        turns = distances.copy()
        for number, pose in enumerate(self.poses):
            if pose.body < min(scenes.shape[-2], len(bodies)):
                x, y, heading = np.moveaxis(scenes[..., pose.body, POSE], -1, 0)
                distances[..., number] = np.hypot(x - pose.x, y - pose.y)
                turns[..., number] = heading_error(heading, pose, bodies)
        return distances, turns

    def judge(
        self, scene: Scene, start: Scene, bodies: Bodies, table: Table = Table()
    ) -> "Judgement":
        """Judge a scene (N, 8), for a goal that was given in the scene `start` (N, 8)."""
        distances, turns = self.errors(scene, bodies)
        kept = [body for body in self.keep if body < len(scene)]
        ways = (scene - start)[kept, POSITION]
        return Judgement(
            self,
            distances,
            np.abs(turns),
            np.hypot(*ways.T),
            bool(is_settled(scene)),
            bool(table.contains(scene[:, POSITION]).all()),
        )


@dataclass(frozen=True, eq=False)
class Judgement:
    """How far a scene is from a goal of P poses and K bodies to be kept."""

    goal: Goal
    distances: Float[ndarray, "P"]  # [m], of the bodies to their places
    turns: Float[ndarray, "P"]  # [rad], at least 0, to their headings; 0 where any will do
    ways: Float[ndarray, "K"]  # [m], by which bodies that are to be kept were moved
    at_rest: bool  # whether all bodies are
    on_table: bool  # whether all bodies are

    @property
    def distance(self) -> float:
        """The largest distance [m]."""
        return float(self.distances.max())

    @property
    def turn(self) -> float:
        """The largest turn [rad]."""
        return float(self.turns.max())

    @property
    def missed(self) -> tuple[int, ...]:
        """The numbers of the poses that are not met within their tolerances."""
        errors = zip(self.goal.poses, self.distances, self.turns, strict=True)
        return tuple(
            number
            for number, (pose, distance, turn) in enumerate(errors)
            if not (distance <= pose.tolerance and turn <= pose.heading_tolerance)
        )

    def moved(self, slack: float = 0.0) -> int | None:
        """Return the first body that was to be kept and was moved, if any.

        It is when it is seen further off than its tolerance and the slack [m].
        """
        for body, way in zip(self.goal.keep, self.ways, strict=False):
            if way > self.goal.keep_tolerance + slack:
                return body
        return None

    @property
    def met(self) -> bool:
        """Whether all bodies are where they should be; they may be moving."""
        return self.on_table and not self.missed and self.moved() is None

    @property
    def reached(self) -> bool:
        """Whether the goal is reached: it is met, and all bodies are at rest."""
        return self.at_rest and self.met


def observed_poses(poses: Float[ndarray, "*B 3"]) -> Float[ndarray, "*B 5"]:
    """Return x, y and heading asked of bodies, NaN where they are not, as `OBSERVED`: finite."""
    asked = np.isfinite(poses[..., [X, THETA]]).astype(np.float64)
    numbers = np.nan_to_num(poses)
    parts = asked[..., :1], numbers[..., POSITION], asked[..., 1:], numbers[..., THETA:]
    return np.concatenate(parts, axis=-1)


def heading_error(headings: Angles, pose: BodyPose, bodies: Bodies) -> Angles:
    """Return by how much headings (...,) [rad] differ from a pose's, modulo the symmetry."""
    if pose.heading is None or bodies.shapes[pose.body].is_round:
        return np.zeros_like(headings)
    turn = bodies.shapes[pose.body].symmetry
    return np.asarray(np.mod(headings - pose.heading + turn / 2, turn) - turn / 2)


def check_tolerance(
    tolerance: float, what: str = "the tolerance", most: float = MOST_TOLERANCE, unit: str = "m"
) -> float:
    """Return a tolerance that is positive and not too large, or raise `OutOfRangeError`."""
    if not 0.0 < tolerance <= most:
        raise OutOfRangeError(
            f"{what} is {tolerance} {unit}; allowed: above 0, up to {most:g} {unit}"
        )
    return tolerance
