"""The bodies of a scene: the shape of each, and what may move it. Constant during an episode.

The state of a body is its row of the scene (`sain_core.scene`). What is here is sent once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Final, Self

import numpy as np

from sain_core.errors import ConfigError, DatasetError, InvalidInputError
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import MOST_BODIES
from sain_core.scene import (
    DISK_HEIGHT,
    MASS,
    OVERLAP_TOLERANCE,
    POSITION,
    RADIUS,
    TARGET,
    Table,
    check_states,
    surface_gaps,
)
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import FEET, Shape
from sain_core.types import Scene, Scenes

CUBE: Final = "cube"


class Role(StrEnum):
    """What may move a body."""

    PUSHABLE = "pushable"  # the tool, and other bodies
    MOVABLE = "movable"  # other bodies only: a push that would touch it with the tool is refused
    FIXED = "fixed"  # nothing


def as_roles(names: Sequence[str]) -> tuple[Role, ...]:
    """Return roles by their names, or raise `ConfigError`."""
    for body, role in enumerate(names):
        if role not in list(Role):
            hint = f"{did_you_mean(role, Role)}; allowed: {', '.join(Role)}"
            raise ConfigError(f"role of body {body} is {role!r}{hint}")
    return tuple(map(Role, names))


@dataclass(frozen=True)
class Bodies:
    """Shape, role and height of each body of a scene; raises `ConfigError` where they cannot be.

    Without roles, body 0 is pushable and all others are movable, as in the paper. Without heights,
    all are `DISK_HEIGHT` high.
    """

    shapes: tuple[Shape, ...]
    roles: tuple[Role, ...] = ()
    heights: tuple[float, ...] = ()  # [m], of the tops over the table

    def __post_init__(self) -> None:
        """Fill in the roles and check them."""
        count = len(self.shapes)
        if not 1 <= count <= MOST_BODIES:
            raise ConfigError(f"a scene has {count} bodies; allowed: 1 to {MOST_BODIES}")
        if not self.roles:
            object.__setattr__(self, "roles", _paper_roles(count))
        if len(self.roles) != count:
            raise ConfigError(f"{count} bodies have {len(self.roles)} roles; give one for each")
        if self.heights and len(self.heights) != count:
            raise ConfigError(f"{count} bodies have {len(self.heights)} heights; give one for each")
        if all(height == DISK_HEIGHT for height in self.heights):
            object.__setattr__(self, "heights", ())
        if Role.PUSHABLE not in self.roles:
            raise ConfigError(
                f"no body is pushable: the roles are {', '.join(self.roles)};"
                " give at least one body the role 'pushable'"
            )

    @classmethod
    def disks(cls, count: int) -> Self:
        """Return so many disks with the paper's roles."""
        return cls((get_shape("disk"),) * count)

    @classmethod
    def named(
        cls, shapes: Sequence[str], roles: Sequence[str] = (), heights: Sequence[float] = ()
    ) -> Self:
        """Return the bodies with shapes and roles of these names, or raise `ConfigError`."""
        found = tuple(get_shape(name, body) for body, name in enumerate(shapes))
        return cls(found, as_roles(roles), tuple(heights))

    def on(self, bottom: str) -> Self:
        """Return the same bodies on feet or on flat bottoms."""
        return replace(self, shapes=tuple(shape.on(bottom) for shape in self.shapes))

    def fitted(self, count: int) -> "Bodies":
        """Return these bodies for a scene of so many: the paper's disks fit any number."""
        return _disks(count) if self.are_paper_disks and len(self) != count else self

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.shapes)

    @property
    def tops(self) -> tuple[float, ...]:
        """How high the tops of bodies are over the table, (N,) [m]."""
        return self.heights or (DISK_HEIGHT,) * len(self)

    @cached_property
    def all_round(self) -> bool:
        """Whether all bodies are disks."""
        return all(shape.is_round for shape in self.shapes)

    @cached_property
    def lie_flat(self) -> bool:
        """Whether all bodies lie on flat bottoms."""
        return all(shape.lies_flat for shape in self.shapes)

    @cached_property
    def has_paper_roles(self) -> bool:
        """Whether only body 0 is pushable and all others are movable."""
        return self.roles == _paper_roles(len(self))

    @cached_property
    def has_target(self) -> bool:
        """Whether body 1 is moved by other bodies alone, as the paper's target."""
        return self.roles[TARGET:][:1] == (Role.MOVABLE,)

    @cached_property
    def are_paper_disks(self) -> bool:
        """Whether these are disks on feet with the paper's roles, which nobody needs to state."""
        flat = any(shape.lies_flat for shape in self.shapes)
        return self.all_round and self.has_paper_roles and not flat and not self.heights

    @cached_property
    def stand_in_for_disks(self) -> bool:
        """Whether these are disks and cubes with the paper's roles.

        A cube stands in for the disk of its radius, as in the paper. What knows only disks predicts
        such scenes as it always did.
        """
        alike = all(shape.is_round or shape.on(FEET).name == CUBE for shape in self.shapes)
        return alike and self.has_paper_roles

    @cached_property
    def pushable(self) -> tuple[int, ...]:
        """The bodies that the tool may touch."""
        return tuple(body for body, role in enumerate(self.roles) if role == Role.PUSHABLE)

    @cached_property
    def fixed(self) -> tuple[int, ...]:
        """The bodies that nothing moves."""
        return tuple(body for body, role in enumerate(self.roles) if role == Role.FIXED)


def _paper_roles(count: int) -> tuple[Role, ...]:
    return (Role.PUSHABLE, *(Role.MOVABLE,) * (count - 1))


_disks = lru_cache(Bodies.disks)
PAPER_DISKS: Final = Bodies.disks(MOST_BODIES)  # as many of them as a scene has bodies


def check_bodies(
    scene: Scene,
    bodies: Bodies = PAPER_DISKS,
    table: Table | None = None,
    most: float = OVERLAP_TOLERANCE,
) -> Scene:
    """Return a scene (N, 8) when it can exist and consist of these bodies.

    Raises `InvalidInputError`, also for outlines that overlap by more than `most` [m];
    `OffTableError`.
    """
    check_states(scene, table)
    bodies = bodies.fitted(len(scene))
    if len(scene) != len(bodies):
        raise InvalidInputError(
            f"the scene has {len(scene)} bodies; {len(bodies)} shapes are known"
        )
    for first, second in combinations(range(len(scene)), 2):
        deep = overlap(scene, bodies, first, second)
        if deep > most:
            raise InvalidInputError(
                f"bodies {first} ({bodies.shapes[first].name}) and {second}"
                f" ({bodies.shapes[second].name}) overlap by {1e3 * deep:.1f} mm;"
                f" at most {1e3 * most:g} mm is allowed"
            )
    return scene


def check_scenes(scenes: Scenes, bodies: Bodies, most: float = OVERLAP_TOLERANCE) -> None:
    """Check scenes (B, N, 8) as `check_bodies` does; a thousand of disks in a millisecond."""
    if bodies.all_round:
        bad = ~np.isfinite(scenes).all(axis=(1, 2))
        bad |= (scenes[..., MASS:] <= 0.0).any(axis=(1, 2))
        bad |= (surface_gaps(scenes) < -most).any(axis=(1, 2))
        scenes = scenes[bad]
    for scene in scenes:
        check_bodies(scene, bodies, most=most)


def overlap(scene: Scene, bodies: Bodies, first: int, second: int) -> float:
    """Return how deep [m] the outlines of two bodies overlap, about; 0 where they are apart.

    About: twice the area that they share, divided by half of its circumference. Of disks exactly.
    """
    from shapely import Polygon

    ends, shapes = scene[[first, second]], (bodies.shapes[first], bodies.shapes[second])
    reach = sum(shape.circumradius * end[RADIUS] for shape, end in zip(shapes, ends, strict=True))
    deep = float(reach - np.hypot(*(ends[0, POSITION] - ends[1, POSITION])))
    if deep <= 0.0 or (shapes[0].is_round and shapes[1].is_round):
        return max(deep, 0.0)
    rings = [Polygon(shape.placed(end)) for shape, end in zip(shapes, ends, strict=True)]
    shared = rings[0].intersection(rings[1])
    return 4.0 * float(shared.area) / float(shared.length) if shared.area else 0.0


BETWEEN: Final = ","


def as_names(bodies: Bodies) -> tuple[str, str]:
    """Return the shapes and the roles of bodies."""
    return BETWEEN.join(shape.name for shape in bodies.shapes), BETWEEN.join(bodies.roles)


@lru_cache(maxsize=1024)
def bodies_named(shapes: str, roles: str, count: int) -> Bodies:
    """Return so many bodies by the names of shapes and roles, or raise `DatasetError`."""
    try:
        bodies = Bodies.named(shapes.split(BETWEEN), roles.split(BETWEEN) if roles else ())
    except ConfigError as error:
        raise DatasetError(f"the bodies {shapes!r} cannot be: {error}") from error
    if len(bodies) != count:
        raise DatasetError(f"{shapes!r} are {len(bodies)} shapes; the scenes have {count} bodies")
    return bodies
