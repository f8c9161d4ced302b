"""Bodies of a user's file, and goals as in the trials of Push Anything (arXiv 2510.19974).

``anything:letter_r`` is that body alone, ``anything:letter_r+push_t`` are two, and ``anything`` is
another body of the file for each seed. They lie flat and have their own heights, of which the least
is that of a body that the simulated tool touches.

The protocol states ranges of goals and how far apart they are; which bodies count as small or big,
and where a trial starts, it does not. Here their size decides, and a trial starts where one ended.
"""

from dataclasses import dataclass
from math import log, pi
from pathlib import Path
from typing import Final, Self

import numpy as np

from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.library import outline_folder, own_bodies, register
from sain_core.shapes.outlines import NO, BodyOutline, named_outlines
from sain_core.shapes.shape import FLAT
from sain_eval.scenes.families import POSE_PUSHES, PUSHES_PER_BODY, Drawn, ScenarioScene
from sain_eval.scenes.placement import Strip, draw_in_strips
from sain_sim.world.parameters import stated_by

ANYTHING: Final = "anything"
SMALL: Final = 0.075  # [m], circumscribed radius up to which a body is small
BIG: Final = 0.12  # [m], from which it is big
STRIPS: Final = {  # of goals, by the protocol
    "small": Strip((0.45, 0.55), 0.25),
    "usual": Strip((0.50, 0.51), 0.30),
    "big": Strip((0.50, 0.51), 0.15),
}
APART: Final = 0.20  # [m], between two goals
FRICTION: Final = (0.25, 0.45)  # with the table; the protocol's models have 0.42
MASSES: Final = (0.05, 1.0)  # [kg], of bodies whose file states none; the protocol's models


def is_anything(name: str) -> bool:
    """Return whether a scenario is one of these."""
    return name.partition(":")[0] == ANYTHING


@dataclass(frozen=True)
class AnythingScenario:
    """Bodies of a user's file to poses; all are pushable."""

    name: str
    bodies: tuple[BodyOutline, ...]
    alone: bool = False  # one of them for each seed

    @classmethod
    def named(cls, name: str, outlines: Path | None = None) -> Self:
        """Return the scenario of this name, with bodies of a file or else of the user's own.

        Raises `ConfigError`: no such body; `DatasetError`: the file cannot be read.
        """
        known = own_bodies(outlines)
        if not known:
            raise ConfigError(
                f"scenario {name!r} has no bodies: give a file with --outlines, or make shapes with"
                f" `sain new_shape`, which go to {outline_folder()}"
            )
        wanted = [one for one in name.partition(":")[2].split("+") if one]
        if not wanted:
            fair = tuple(one for one in known.values() if one.fair != NO)
            if not fair:
                raise ConfigError(f"none of {', '.join(known)} is fair as a flat body; name one")
            return cls(name, fair, alone=True)
        return cls(name, named_outlines(known, wanted))

    def scene(self, seed: int) -> ScenarioScene:
        """Draw friction, starts and goals, and masses that are not stated."""
        random = generator(seed, "scenario", self.name)
        bodies = (self.bodies[seed % len(self.bodies)],) if self.alone else self.bodies
        drawn = _drawn(bodies, random)
        strips = [_strip(size) for size in drawn.sizes.tolist()]
        disks = drawn.turned(draw_in_strips(drawn.sizes, strips, APART, random), random)
        kinds, (heights, mass_centres) = Bodies.named(drawn.shapes), stated_by(bodies)
        while True:
            places = draw_in_strips(drawn.sizes, strips, APART, random)
            goal = drawn.goal(places, random.uniform(-pi, pi, len(bodies)))
            if not goal.judge(disks, disks, kinds).reached:
                break
        return drawn.case(
            self.name,
            seed,
            disks,
            goal,
            max_pushes=POSE_PUSHES if len(bodies) == 1 else PUSHES_PER_BODY * len(bodies),
            roles=(Role.PUSHABLE,) * len(bodies),
            heights=heights,
            mass_centres=mass_centres,
        )


def _drawn(bodies: tuple[BodyOutline, ...], random: np.random.Generator) -> Drawn:
    for one in bodies:
        register(one.shape)
    radii = np.array([one.radius for one in bodies])
    masses = np.exp(random.uniform(log(MASSES[0]), log(MASSES[1]), len(bodies)))
    return Drawn(
        np.array([one.mass or drawn for one, drawn in zip(bodies, masses.tolist(), strict=True)]),
        radii,
        radii * [one.shape.circumradius for one in bodies],
        tuple(one.shape.on(FLAT).name for one in bodies),
        float(random.uniform(*FRICTION)),
    )


def _strip(size: float) -> Strip:
    return STRIPS["small" if size <= SMALL else "big" if size >= BIG else "usual"]
