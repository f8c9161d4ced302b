"""The world that stands for reality: the paper's randomised one, or a laboratory."""

from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.shapes.shape import BOTTOMS, FEET, FLAT
from sain_sim.world.effects import (
    EFFECTS,
    LABS,
    MOVED_FEET,
    PRESSURE,
    TABLE_FRICTION,
    check_effects,
    draw_effects,
    effects_of,
)
from sain_sim.world.engines import BULLET, DEFAULT_ENGINE, ENGINE_HELP, check_engine
from sain_sim.world.parameters import (
    PAPER,
    RANGES,
    Ranges,
    WorldParameters,
    nominal_parameters,
    sample_parameters,
)
from sain_sim.world.roughness import fit_shapes

RANDOMISED: Final = "randomised"
NOMINAL: Final = "nominal"
TRUTHS: Final = (RANDOMISED, *LABS, NOMINAL)
ALL: Final = "all"
NONE: Final = "none"
VARIED_FRICTION: Final = "friction"  # not part of "all": friction hides, it is not structure
KNOWN_EFFECTS: Final = (*EFFECTS, VARIED_FRICTION)


@dataclass(frozen=True)
class TruthConfig(Config):
    """The world that executes the pushes.

    A rough or measured world is one lab: table, make of the disks, arm and friction stay the same
    in all episodes. Masses and radii are drawn for each.
    """

    world: str = option(
        RANDOMISED,
        "the paper's world, a laboratory with rough or with measured effects, or the nominal one",
        choices=TRUTHS,
    )
    effects: str = option(
        ALL,
        "effects of a laboratory: all that its world has, none, or a list of"
        f" {', '.join(KNOWN_EFFECTS)}",
    )
    lab: int = option(0, "number of the laboratory", minimum=0)
    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    bottom: str = option(
        FEET, "what bodies stand on: three feet, or a flat bottom", choices=BOTTOMS
    )

    def __post_init__(self) -> None:
        """Check the fields, that every effect is one, and that the engine has them."""
        super().__post_init__()
        for effect in self.effect_names:
            if effect not in KNOWN_EFFECTS:
                known = ", ".join((ALL, NONE, *KNOWN_EFFECTS))
                raise ConfigError(f"effect is {effect!r}; allowed: {known}")
        check_engine(self.engine)
        names = self.effect_names if self.world in LABS else ()
        check_effects(self.engine, [name for name in names if name in EFFECTS])
        if MOVED_FEET in names and (self.bottom == FLAT or PRESSURE in names):
            effects = ",".join(name for name in names if name != MOVED_FEET)
            raise ConfigError(f"bodies with a flat bottom have no feet to be moved; use {effects}")

    def settings(self) -> dict[str, Any]:
        """Return the fields; engine and bottom only where they are not the first ones.

        Collections and evaluations from before there was a choice go on.
        """
        first = {"engine": BULLET, "bottom": FEET}
        return {k: v for k, v in asdict(self).items() if first.get(k) != v}

    @property
    def effect_names(self) -> tuple[str, ...]:
        """The effects that are on in a laboratory; "all" may stand among others."""
        words = [word.strip() for word in self.effects.split(",") if word.strip()]
        if words == [NONE]:
            return ()
        if not words:
            raise ConfigError(f"effects is {self.effects!r}; {NONE!r} switches all of them off")
        names = [
            name for word in words for name in (effects_of(self.world) if word == ALL else (word,))
        ]
        return tuple(dict.fromkeys(names))

    def draw(
        self,
        random: np.random.Generator,
        count: int = 2,
        ranges: Ranges = RANGES[PAPER],
        shapes: tuple[str, ...] = (),
    ) -> WorldParameters:
        """Draw the parameters of one episode with N = count bodies; without shapes, of disks."""
        if self.world == NOMINAL:
            drawn = nominal_parameters(count)
        else:
            drawn = sample_parameters(random, count, ranges)
        return self.roughen(replace(drawn, shapes=shapes) if shapes else drawn)

    def roughen(self, parameters: WorldParameters) -> WorldParameters:
        """Return these bodies in this world; only a laboratory changes them.

        Each stands on the feet of its shape, off by the errors of the laboratory, or lies flat.
        """
        names = self.effect_names
        if self.bottom == FLAT or (self.world in LABS and PRESSURE in names):
            parameters = parameters.on(FLAT)
        if self.world not in LABS:
            return parameters
        effects = [name for name in names if name in EFFECTS]
        drawn = draw_effects(self.world, self.lab, effects, parameters.count)
        drawn["roughness"] = fit_shapes(drawn["roughness"], parameters.body_shapes)
        if VARIED_FRICTION not in names:
            friction = generator(self.lab, "lab", "friction").uniform(*TABLE_FRICTION[self.world])
            drawn["friction"] = float(friction)
        return replace(parameters, **drawn)


RANDOMISED_TRUTH: Final = TruthConfig()
