"""The world that stands for reality: the paper's randomised one, or a laboratory with effects.

An effect says which engines simulate it, and what it is drawn from in each world. A lab's table,
bodies and tool stay the same in all episodes. docs/explanation/worlds.md states the size of each
effect, and its reason.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from math import asin, cos, log, pi, radians, sin
from typing import Any, Final, NamedTuple

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import did_you_mean
from sain_core.randomness import generator
from sain_core.scene import Table
from sain_core.shapes.shape import BOTTOMS, FEET, FLAT, FOOT_BEARINGS, Pair
from sain_core.shapes.solids import EVEN
from sain_sim.world.engines import (
    BULLET,
    DEFAULT_ENGINE,
    ENGINE_HELP,
    ENGINES,
    MUJOCO,
    check_engine,
)
from sain_sim.world.parameters import (
    PAPER,
    RANGES,
    Ranges,
    WorldParameters,
    nominal_parameters,
    sample_parameters,
)
from sain_sim.world.roughness import Roughness, Wave, fit_shapes

ROUGH: Final = "rough"
MEASURED: Final = "measured"
LABS: Final = (ROUGH, MEASURED)  # the worlds that are laboratories

TILT: Final = (radians(0.5), radians(1.0))
FOOT_DISTANCE: Final = (0.6, 0.8)  # [radii]; a regular foot stands at 0.7
FOOT_TURN: Final = radians(15)  # either way from its regular bearing
WAVES: Final = 3  # of which the patches are made
GRAIN: Final = (0.6, 0.8)  # friction along y over friction along x
TOOL_STIFFNESS: Final = (2000.0, 3000.0)  # [N/m], the upper end of Franka's Cartesian impedance
RIM_FRICTION: Final = (0.2, 0.4)  # the prior assumes 0.12
MASS_OFFSET: Final = {ROUGH: (0.08, 0.15), MEASURED: (0.0, 0.15)}  # [radii], to the centre of mass
WAVE_LENGTH: Final = {ROUGH: (0.2, 0.4), MEASURED: (0.5, 1.0)}  # [m], patches are half as wide
TABLE_FRICTION: Final = {ROUGH: (0.08, 0.20), MEASURED: (0.1, 0.3)}
# What was identified on real pushes (docs/explanation/worlds.md)
TABLE_RATIO: Final = 2.0  # of the table's largest friction to its smallest
SPREAD: Final = (0.5, 1.3)  # torsion over that of uniform pressure
UNEVEN: Final = 0.5  # deviation of the logarithms of the supports' weights
TOOL_FRICTION: Final = (0.12, 0.31)
CONTACT_TIME: Final = (0.004, 0.02)  # [s], the upper end is MuJoCo's default
TOOL_OFFSET: Final = 0.002  # [m], at most
NOISE: Final = (0.0003, 0.32)  # tool [m], logarithm of the friction below a support

RIMS: Final = "rims"
MOVED_FEET: Final = "feet"
PRESSURE: Final = "pressure"
BOTH: Final = (BULLET, MUJOCO)

Values = dict[str, Any]
Draw = Callable[[np.random.Generator, int, str], Values]


class Effect(NamedTuple):
    """One difference of a laboratory from the nominal world.

    Attributes:
        field: of `Roughness` or `WorldParameters`, which differs from its default.
        draw: returns values of that field, and of others, for N bodies in a world.
        worlds: that have it with "all".
        engines: that simulate it.
    """

    field: str
    draw: Draw
    worlds: tuple[str, ...]
    engines: tuple[str, ...] = BOTH


def _mass_offsets(random: np.random.Generator, count: int, world: str) -> Values:
    drawn = [(random.uniform(*MASS_OFFSET[world]), random.uniform(-pi, pi)) for _ in range(count)]
    return {"mass_offsets": tuple((away * cos(turn), away * sin(turn)) for away, turn in drawn)}


def _feet(random: np.random.Generator, count: int, world: str) -> Values:
    def foot(regular: float) -> Pair:
        turn = random.uniform(-FOOT_TURN, FOOT_TURN)
        return random.uniform(*FOOT_DISTANCE), regular + turn

    return {"feet": tuple(tuple(map(foot, FOOT_BEARINGS)) for _ in range(count))}


def _pressures(random: np.random.Generator, count: int, world: str) -> Values:
    def pressure() -> tuple[float, ...]:
        spread = random.uniform(*SPREAD)
        return spread, *np.exp(random.normal(0.0, UNEVEN, EVEN)).tolist()

    return {"pressures": tuple(pressure() for _ in range(count))}


def _patches(random: np.random.Generator, count: int, world: str) -> Values:
    number = 2 * pi / random.uniform(*WAVE_LENGTH[world], WAVES)
    bearing, phase = random.uniform(-pi, pi, (2, WAVES))
    waves = np.stack([number * np.cos(bearing), number * np.sin(bearing), phase], axis=-1)
    drawn: tuple[Wave, ...] = tuple(tuple(wave) for wave in waves.tolist())
    if world == ROUGH:
        return {"patches": drawn}
    return {"patches": drawn, "patch_depth": _depth(Roughness(patches=drawn, patch_depth=1.0))}


def _depth(waves: Roughness) -> float:
    """Return the depth with which waves of depth 1 have `TABLE_RATIO` over the table."""
    table = Table()
    xs, ys = (
        np.linspace(low, high, 25)
        for low, high in ((table.x_min, table.x_max), (table.y_min, table.y_max))
    )
    heights = np.log([waves.friction_factor(x, y) for x in xs for y in ys])
    return log(TABLE_RATIO) / float(np.ptp(heights))


def _tilt(random: np.random.Generator, count: int, world: str) -> Values:
    steep, bearing = sin(random.uniform(*TILT)), random.uniform(-pi, pi)
    return {"tilt": (asin(steep * cos(bearing)), asin(steep * sin(bearing)))}


def _soft(random: np.random.Generator, count: int, world: str) -> Values:
    low, high = CONTACT_TIME
    tool, bodies = (low * (high / low) ** share for share in random.uniform(size=2).tolist())
    return {"contact_times": (tool, bodies)}


def _offset(random: np.random.Generator, count: int, world: str) -> Values:
    away, bearing = random.uniform(0.0, TOOL_OFFSET), random.uniform(-pi, pi)
    return {"tool_offset": (away * cos(bearing), away * sin(bearing))}


def _uniform(field: str, within: Pair) -> Draw:
    return lambda random, count, world: {field: float(random.uniform(*within))}


def _constant(field: str, value: Any) -> Draw:
    return lambda random, count, world: {field: value}


EFFECTS: Final[Mapping[str, Effect]] = {
    "mass": Effect("mass_offsets", _mass_offsets, LABS),
    MOVED_FEET: Effect("feet", _feet, (ROUGH,)),
    PRESSURE: Effect("pressures", _pressures, (MEASURED,), (MUJOCO,)),
    "patches": Effect("patches", _patches, LABS),
    "direction": Effect("grain", _uniform("grain", GRAIN), (ROUGH,), (BULLET,)),
    "tilt": Effect("tilt", _tilt, (ROUGH,)),
    "tool": Effect(
        "tool_stiffness", _uniform("tool_stiffness", TOOL_STIFFNESS), (ROUGH,), (BULLET,)
    ),
    "torque": Effect("stock_joints", _constant("stock_joints", True), (ROUGH,), (BULLET,)),
    RIMS: Effect("rim_friction", _uniform("rim_friction", RIM_FRICTION), (ROUGH,)),
    "grip": Effect("tool_friction", _uniform("tool_friction", TOOL_FRICTION), (MEASURED,)),
    "soft": Effect("contact_times", _soft, (MEASURED,), (MUJOCO,)),
    "offset": Effect("tool_offset", _offset, (MEASURED,), (MUJOCO,)),
    "noise": Effect("noise", _constant("noise", NOISE), (MEASURED,), (MUJOCO,)),
}


def effects_of(world: str) -> tuple[str, ...]:
    """Return the effects that a world has when all are on."""
    return tuple(name for name, effect in EFFECTS.items() if world in effect.worlds)


def draw_effects(world: str, lab: int, names: Iterable[str], count: int) -> Values:
    """Draw the effects of these names for a lab with N = count bodies.

    Each has a random stream of its own, so it is the same alone and among others.

    Returns:
        ``roughness``, and fields of `WorldParameters`.
    """
    values: Values = {}
    for name in names:
        values |= EFFECTS[name].draw(generator(lab, "lab", name), count, world)
    own = Roughness.__dataclass_fields__
    rough = {name: values.pop(name) for name in tuple(values) if name in own}
    return {"roughness": Roughness(**rough), **values}


def check_effects(engine: str, effects: Iterable[str]) -> None:
    """Raise `ConfigError` when an engine lacks one of these effects; a package's has none."""
    wanted = tuple(effects)
    lacking = [name for name in wanted if engine not in EFFECTS[name].engines]
    if not lacking:
        return
    able = [one for one in ENGINES if all(one in EFFECTS[name].engines for name in wanted)]
    lacks = [name for name, effect in EFFECTS.items() if engine not in effect.engines]
    use = [f"engine {one}" for one in able]
    use.append(
        "effects none" if len(lacks) == len(EFFECTS) else f"effects without {', '.join(lacks)}"
    )
    raise ConfigError(
        f"engine {engine} cannot simulate {', '.join(lacking)}; use {', or '.join(use)}"
    )


def check_roughness(engine: str, roughness: Roughness) -> None:
    """Raise `ConfigError` when an engine lacks one of the effects that are on."""
    on = roughness.arrays()
    check_effects(engine, [name for name, effect in EFFECTS.items() if effect.field in on])


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
                known = (ALL, NONE, *KNOWN_EFFECTS)
                hint = did_you_mean(effect, known)
                raise ConfigError(f"effect is {effect!r}{hint}; allowed: {', '.join(known)}")
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


def hidden_world(engine: str) -> str:
    """Return the world with the most hidden properties that an engine of ours simulates."""
    return MEASURED if engine == MUJOCO else RANDOMISED
