"""The parameters of a world: masses, radii, shapes and friction.

Numbers from the paper, section III-A; it gives one friction coefficient and we read it as the
one between disks and table. Rims and tool keep its nominal value.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import Final, NamedTuple, Self

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT, MASS, NOMINAL_MASS, RADIUS, Table, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import LEAST_MASS, MOST_HEIGHT, MOST_MASS, BodyOutline
from sain_core.shapes.shape import Pair, Shape, feet_places
from sain_core.shapes.solids import DISK, even_supports
from sain_core.types import Angles, Points, Scalars, Scene
from sain_sim.world.roughness import SMOOTH, Roughness

NOMINAL_RADII: Final = (0.08, 0.06)  # [m], mid disk and target
NOMINAL_FRICTION: Final = 0.12
MASS_RANGE: Final = (7.0, 9.0)  # [kg]
RADIUS_RANGES: Final = ((0.075, 0.085), (0.055, 0.065))  # [m]
FRICTION_RANGE: Final = (0.08, 0.20)
FOOT_RADIUS: Final = 0.004  # [m]
FLOOR_SIZE: Final = 3.0  # [m], half its side
THINNEST_TABLE: Final = 0.05  # [m], of a table as high as the arm's base
ROOM: Final = 1.05  # [reaches], of each body in the first scene


PUSHED_AT: Final = DISK_HEIGHT / 2  # [m], height of the tool's contact
LEAST_HEIGHT: Final = 0.025  # [m], of a body that the tool touches below its top
SOFT: Final = 0.002  # [m], by which a flat bottom, which gives way, carries less far out


class Ranges(NamedTuple):
    """What the parameters of an episode are drawn from, evenly."""

    mass: Pair  # [kg]
    radii: tuple[Pair, Pair]  # [m], of the mid disk, and of the target and all further ones
    friction: Pair  # with the table


PAPER: Final = "paper"
WIDE: Final = "wide"
RANGES: Final = {
    PAPER: Ranges(MASS_RANGE, RADIUS_RANGES, FRICTION_RANGE),
    # Far outside of what is trained on; radii are the nominal ones give or take 20 %.
    WIDE: Ranges((5.0, 12.0), ((0.064, 0.096), (0.048, 0.072)), (0.05, 0.35)),
}


@dataclass(frozen=True)
class WorldParameters(Config):
    """The physical parameters of a world with N disks, the mid disk first."""

    masses: tuple[float, ...] = option(
        (NOMINAL_MASS, NOMINAL_MASS), "masses", unit="kg", minimum=LEAST_MASS, maximum=MOST_MASS
    )
    radii: tuple[float, ...] = option(
        NOMINAL_RADII,
        "radii, the units of outlines",
        unit="m",
        minimum=0.02,
        maximum=0.2,
    )
    shapes: tuple[str, ...] = option((DISK, DISK), "shape of each body")
    friction: float = option(
        NOMINAL_FRICTION, "friction with the table", minimum=0.005, maximum=1.5
    )
    rim_friction: float = option(
        NOMINAL_FRICTION, "friction between disks", minimum=0.005, maximum=1.5
    )
    tool_friction: float = option(
        NOMINAL_FRICTION, "friction of the tool on a disk", minimum=0.0, maximum=1.5
    )
    heights: tuple[float, ...] = option(
        (),
        "heights; none: 40 mm. The centre of mass is at half of it",
        unit="m",
        minimum=LEAST_HEIGHT,
        maximum=MOST_HEIGHT,
    )
    roughness: Roughness = SMOOTH
    roles: tuple[str, ...] = option(
        (), "pushable, movable or fixed, for each body; none: only the first is pushable"
    )

    def __post_init__(self) -> None:
        """Check the fields, and that they are about the same disks."""
        super().__post_init__()
        counts = {len(self.masses), len(self.radii), len(self.shapes)}
        if len(counts) > 1 or min(counts) < 1:
            raise ConfigError(
                f"WorldParameters has {len(self.masses)} masses, {len(self.radii)} radii and"
                f" {len(self.shapes)} shapes; it needs one of each for every body, 1 or more"
            )
        flat = {shape.lies_flat for shape in self.bodies.shapes}
        if len(flat) > 1:
            raise ConfigError(
                f"the shapes are {', '.join(self.shapes)}: in one world all bodies lie flat or all"
                " stand on feet"
            )
        self.roughness.check_count(self.count)
        if self.roughness.feet and self.lies_flat:
            raise ConfigError(
                "what lies flat has no feet to be moved; use bottom feet, or effects without feet"
            )
        if self.roughness.pressures and not self.lies_flat:
            raise ConfigError("feet have no pressure to be drawn; use bottom flat")

    @property
    def count(self) -> int:
        """The number of disks N."""
        return len(self.masses)

    @cached_property
    def bodies(self) -> Bodies:
        """Shape, role and height of each body."""
        return Bodies.named(self.shapes, self.roles, self.heights)

    @property
    def body_shapes(self) -> tuple[Shape, ...]:
        """What each disk is like."""
        return self.bodies.shapes

    @property
    def lies_flat(self) -> bool:
        """Whether bodies have flat bottoms."""
        return self.bodies.lie_flat

    @property
    def bottom(self) -> str:
        """What all bodies stand on."""
        return self.body_shapes[0].bottom

    def on(self, bottom: str) -> Self:
        """Return the same world with all bodies on this bottom."""
        shapes = tuple(shape.name for shape in self.bodies.on(bottom).shapes)
        return self if shapes == self.shapes else replace(self, shapes=shapes)

    def supports(self, body: int) -> Points:
        """Return the points (F, 2) [m] in a body's frame that carry it, about its middle."""
        shape, radius = self.body_shapes[body], self.radii[body]
        if self.lies_flat:
            return radius * self.roughness.supports(body, shape)[0]
        return feet_places(self.roughness.feet[body] if self.roughness.feet else shape.feet, radius)

    def loads(self, body: int) -> Scalars:
        """Return the weights (F,) of a flat body's supports: how stiff they are, in sum 1."""
        return self.roughness.supports(body, self.body_shapes[body])[1]

    @cached_property
    def tops(self) -> Scalars:
        """How high the bodies' tops are when they stand on the table, (N,) [m]."""
        return np.array(self.bodies.tops)

    @property
    def mass_offsets(self) -> tuple[Pair, ...]:
        """Each disk's centre of mass in its frame [m]."""
        shares = (self.roughness.mass_offset(disk) for disk in range(self.count))
        return tuple((r * x, r * y) for r, (x, y) in zip(self.radii, shares, strict=True))

    def scene(self, positions: Points, headings: Angles | None = None) -> Scene:
        """Return the scene (N, 8) at rest with these disks at positions (N, 2) [m]."""
        return make_scene(positions, np.array(self.masses), np.array(self.radii), headings)

    def with_stated(self, heights: tuple[float, ...], mass_centres: tuple[Pair, ...]) -> Self:
        """Return the bodies with heights and centres of mass from their centroids [m]; (): ours."""
        if mass_centres:
            about = zip(mass_centres, self.radii, strict=True)
            offsets = tuple((x / radius, y / radius) for (x, y), radius in about)
            return replace(
                self, heights=heights, roughness=replace(self.roughness, mass_offsets=offsets)
            )
        return replace(self, heights=heights)

    @classmethod
    def of_scene(
        cls,
        scene: Scene,
        friction: float = NOMINAL_FRICTION,
        shapes: tuple[str, ...] | None = None,
        roles: tuple[str, ...] = (),
    ) -> Self:
        """Return parameters with the masses and radii of a scene (N, 8)."""
        return cls(
            masses=tuple(scene[:, MASS].tolist()),
            radii=tuple(scene[:, RADIUS].tolist()),
            shapes=shapes or (DISK,) * len(scene),
            roles=roles,
            friction=friction,
        )


def stated_by(
    bodies: Iterable[BodyOutline | None],
) -> tuple[tuple[float, ...], tuple[Pair, ...]]:
    """Return heights and centres of mass of bodies as users state them, for `with_stated`.

    None is a body of ours. The simulated tool touches none that is lower than `LEAST_HEIGHT`.
    """
    known = tuple(bodies)
    tops = (DISK_HEIGHT if one is None else one.height or DISK_HEIGHT for one in known)
    heights = tuple(max(top, LEAST_HEIGHT) for top in tops)
    centres = tuple((one and one.mass_centre) or (0.0, 0.0) for one in known)
    return heights, centres if any(map(any, centres)) else ()


@cache
def nominal_parameters(count: int = 2, shapes: tuple[str, ...] | None = None) -> WorldParameters:
    """Return the paper's nominal world with N = count disks; further disks are like the target."""
    return WorldParameters(
        masses=(NOMINAL_MASS,) * count,
        radii=tuple(NOMINAL_RADII[min(disk, 1)] for disk in range(count)),
        shapes=shapes or (DISK,) * count,
    )


def sample_parameters(
    generator: np.random.Generator,
    count: int = 2,
    ranges: Ranges = RANGES[PAPER],
) -> WorldParameters:
    """Draw the paper's randomised world with N = count disks; further ones like the target."""
    return WorldParameters(
        masses=tuple(generator.uniform(*ranges.mass, count).tolist()),
        radii=tuple(float(generator.uniform(*ranges.radii[min(i, 1)])) for i in range(count)),
        shapes=(DISK,) * count,
        friction=float(generator.uniform(*ranges.friction)),
    )


def check_stands(parameters: WorldParameters, friction: float = 0.0) -> None:
    """Check that bodies do not tip over when they are pushed, as thin ones do.

    Friction acts on the bottom, the tool `PUSHED_AT` above it: a body tips about the edge of its
    supports where that is nearer to the centroid than friction times this height. Errors of a
    laboratory are left out.

    Args:
        parameters: of the world.
        friction: with the table, where that is larger than the world's.

    Raises:
        ConfigError: one tips; naming the least width.
    """
    friction = max(friction, parameters.friction)
    need = PUSHED_AT * friction + (SOFT if parameters.lies_flat else 0.0)
    for body, (shape, radius) in enumerate(
        zip(parameters.body_shapes, parameters.radii, strict=True)
    ):
        within, wide = _base(shape)
        if body in parameters.bodies.fixed or radius * within >= need:
            continue
        raise ConfigError(
            f"body {body} ({shape.name}) is {1e3 * radius * wide:.0f} mm wide and"
            f" {1e3 * parameters.tops[body]:.0f} mm high: it tips over when it is pushed"
            f" {1e3 * PUSHED_AT:.0f} mm above a table with friction {friction:.2f}; make it about"
            f" {1e3 * wide * need / within:.0f} mm wide, or wider"
        )


@lru_cache(maxsize=1024)
def _base(shape: Shape) -> Pair:
    """Return how far a centroid is within the supports, and the width of the body [radii]."""
    from shapely import MultiPoint, Point, Polygon

    supports = even_supports(shape) if shape.lies_flat else feet_places(shape.feet, 1.0)
    within = float(MultiPoint(supports).convex_hull.exterior.distance(Point(0.0, 0.0)))
    corners = Polygon(shape.outline(1.0)).minimum_rotated_rectangle.exterior.coords
    sides = np.hypot(*np.diff(np.array(corners), axis=0).T)
    return within, float(sides.min())


def table_box(table: Table) -> tuple[list[float], list[float]]:
    """Return half the sides and the middle [m] of a table: a box down to the floor."""
    half = [
        (table.x_max - table.x_min) / 2,
        (table.y_max - table.y_min) / 2,
        max(table.height, THINNEST_TABLE) / 2,
    ]
    return half, [(table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2, -half[2]]


def on_a_grid(parameters: WorldParameters, table: Table) -> Scene:
    """Return a scene with the bodies in rows about the table's middle, each with room to turn."""
    reach = [
        r * s.circumradius for r, s in zip(parameters.radii, parameters.body_shapes, strict=True)
    ]
    room = 2.0 * ROOM * max(reach)
    columns = max(1, int((table.y_max - table.y_min) / room))
    row, column = np.divmod(np.arange(parameters.count), min(columns, parameters.count))
    middle = [(table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2]
    places = np.stack([row - row.max() / 2, column - column.max() / 2], axis=-1)
    return parameters.scene(middle + room * places)
