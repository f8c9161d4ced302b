"""Kinds of physics, each with its parameters: how certain they are, before any push.

A vector z has one number for each parameter of a kind. 0 is what the kind's prior has, and 1 is one
spread of the parameter away: in the logarithm or in the value, as `sain_model.physics.parameters`
states it. A belief is kept as JSON.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.config import typed_settings
from sain_core.errors import CheckpointError
from sain_core.guarding.documents import read_json
from sain_core.model import Model
from sain_core.output import write_json
from sain_core.provenance import FORMAT, other_format
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.physics.parameters import (
    BY_HEADING,
    BY_NAME,
    TEXTBOOK,
    Parameter,
    PlanarConfig,
    Values,
    check_values,
)
from sain_model.physics.planar import PlanarPrior, step_knowing

FRICTION: Final = "friction"
MASS_RATIO: Final = "mass_ratio"
LABORATORY: Final = (  # what pushes show of the physics of a table, a tool and bodies
    FRICTION, "tool_friction", "disk_friction", "tool_restitution", "disk_restitution",
    "foot_radius", "inertia", "tool_height", "disk_height", "middle_height", "speed_factor",
    "centre_x", "centre_y", "slope_x", "slope_y", "table_grain_x", "table_grain_y",
    "tip_x", "tip_y", "length_offset",
)  # fmt: skip
BODY_ON_SURFACE: Final = (  # what pushes show of a body on a surface, and of where the tool is
    "tool_friction", "torsion", "pressure", "centre_x", "centre_y", "grain_x", "grain_y",
    "table_grain_x", "table_grain_y", "tip_x", "tip_y", "length_offset",
)  # fmt: skip
OF_TABLE: Final = (  # what many pushes show besides: of a table, and of a robot that is not exact
    "slope_x", "slope_y", "table_grain_x", "table_grain_y", "centre_x", "centre_y", "torsion",
    "tool_compliance", "length_offset", "angle_offset", "location_offset", *BY_HEADING,
)  # fmt: skip
ACROSS: Final = "yield_across"
ALONG_AXES: Final = "axes_yield"
POINTS: Final = {FRICTION: 61, MASS_RATIO: 17}  # of a grid, for parameters that have one
REACH: Final = 2.8  # [standard deviations], of a grid

SOLVER_AXES: Final = "solver axes"
FITTED: Final = "fitted"
NO_AXES: Final = "textbook"
TRAINED: Final = 3.0  # logarithm of the odds that the physics is of the kind that is trained on
TEMPER: Final = 0.3  # of bodies on surfaces
KEEP: Final = 0.5  # logarithm of the odds that a network's correction holds, beforehand
OF_NEW: Final = -2.0  # likewise for a body that it did not learn from

OWN: Final = {  # share of a parameter's variance that is of the episode, or of each of its bodies
    "centre_x": 0.9,
    "centre_y": 0.9,
    "body": 0.5,  # other parameters by their scope
    "episode": 0.5,
    "table": 0.1,
    "tool": 0.1,
}
WIDE: Final = {"centre_x": 2.0, "centre_y": 2.0}  # [spreads], deviations of z of unknown bodies
SHARED: Final = -1  # of a parameter that all bodies share, in place of a body's number

Places = Float[ndarray, "R D"]  # a vector z for each of R rows


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of physics, and what is believed of its parameters."""

    name: str  # for people
    prior: Model  # with the most likely parameters
    # of the D parameters that pushes show; none: the prior stays as it is
    names: tuple[str, ...] = (FRICTION,)
    # of the vector z, (D, D)
    covariance: Float[ndarray, "D D"] = field(default_factory=lambda: np.eye(1))
    log_odds: float = 0.0  # logarithm of how likely this kind is, up to a constant
    flat_log_odds: float = 0.0  # what is added to it where all bodies lie flat
    only_flat: bool = False  # whether it is of no other bodies
    corrected: bool = False  # whether the network was trained on this kind
    # whether episodes are those of a body on a surface each, which has a value of its own of every
    # parameter
    of_bodies: bool = False
    # of the vector z, (D, D): what each body of a scene has of its own; None: a half of what is
    # believed of parameters of bodies
    own: Float[ndarray, "D D"] | None = None
    # of a scene: the body of each parameter, or `SHARED`; empty: all bodies have the same values
    body: tuple[int, ...] = ()

    def log_odds_of(self, bodies: Bodies) -> float:
        """Return the logarithm of how likely this kind is for bodies, up to a constant."""
        if bodies.lie_flat:
            return self.log_odds + self.flat_log_odds
        return -np.inf if self.only_flat else self.log_odds

    @property
    def temper(self) -> float:
        """What one push counts: errors of one body's pushes have causes in common."""
        return TEMPER if self.of_bodies else 1.0

    @property
    def identity(self) -> str:
        """A text that changes with what is believed, for the state of a training."""
        settings = self.prior.config if isinstance(self.prior, PlanarPrior) else ""
        return f"{settings} {self.names} {self.covariance.tolist()}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The D parameters that pushes show."""
        return tuple(BY_NAME[name] for name in self.names)

    @property
    def config(self) -> PlanarConfig:
        """The settings of the prior, which is a planar one where there are parameters."""
        assert isinstance(self.prior, PlanarPrior)
        return self.prior.config

    @property
    def has_axes(self) -> bool:
        """Whether friction is solved along the world's axes, be their weight 0."""
        return ALONG_AXES in self.names or self.config.has_axes

    @cached_property
    def deviations(self) -> Float[ndarray, "D"]:
        """Standard deviations of z."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def stated(self) -> dict[str, tuple[float, float]]:
        """The value of each parameter and its spread: of the logarithm, if it is a factor."""
        return {
            one.name: (float(getattr(self.config, one.name)), float(one.spread * deviation))
            for one, deviation in zip(self.parameters, self.deviations, strict=True)
        }

    @cached_property
    def precision(self) -> Float[ndarray, "D D"]:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)

    @property
    def on_grid(self) -> list[str]:
        """The parameters that a grid covers; their spreads make the regions of predictions."""
        return [name for name in self.names if name in POINTS]

    @cached_property
    def grid(self) -> Places:
        """The G places of the grid; parameters without one stay at 0."""
        columns = [self.names.index(name) for name in self.on_grid]
        axes = [
            np.linspace(-REACH, REACH, POINTS[self.names[column]]) * self.deviations[column]
            for column in columns
        ]
        mesh = np.meshgrid(*axes, indexing="ij")
        places = np.zeros((mesh[0].size if mesh else 1, len(self.names)))
        for column, axis in zip(columns, mesh, strict=True):
            places[:, column] = axis.ravel()
        return places

    @cached_property
    def grid_log_prior(self) -> Float[ndarray, "G"]:
        """The logarithm of the probability of each place of the grid before any push."""
        log_prior = -0.5 * ((self.grid / self.deviations) ** 2).sum(axis=1)
        return np.asarray(log_prior - np.log(np.exp(log_prior).sum()))

    def values(self, places: Places) -> dict[str, ndarray]:
        """Return the values of all parameters at vectors z (R, D), by name.

        They are (R,), and (R, N) of parameters of each of N bodies. Vectors of several kinds are as
        long as the longest.
        """
        found: dict[str, list[Scalars]] = {}
        for name, value in zip(self.names, self._each(places), strict=True):
            found.setdefault(name, []).append(value)
        return {
            name: values[0] if len(values) == 1 else np.stack(values, axis=1)
            for name, values in found.items()
        }

    def _each(self, places: Places) -> list[Scalars]:
        """Return the value (R,) of each element of vectors z (R, D)."""
        return [
            _value(parameter, getattr(self.config, parameter.name), z)
            for parameter, z in zip(self.parameters, places.T[: len(self.names)], strict=True)
        ]

    def at_most(self, places: Places) -> Bool[ndarray, "R D"]:
        """Return which parameters have their largest value at vectors z (R, D)."""
        each = zip(self.parameters, self._each(places), strict=True)
        full = [value >= one.most for one, value in each]
        return np.stack(full, axis=1) if full else np.zeros(places.shape, bool)

    def value(self, name: str, places: Places) -> ndarray | float:
        """Return one value at vectors z; the default of a parameter that the prior has not."""
        if name in self.names:
            return self.values(places)[name]
        config = self.prior.config if isinstance(self.prior, PlanarPrior) else PlanarConfig()
        return float(getattr(config, name))

    def at(self, place: Float[ndarray, "D"]) -> Model:
        """Return the prior at one vector z."""
        if not self.names:
            return self.prior
        assert isinstance(self.prior, PlanarPrior)
        values = {name: value[0] for name, value in self.values(place[None]).items()}
        shared: dict[str, Any] = {n: float(value) for n, value in values.items() if not value.ndim}
        config = replace(self.config, **shared)
        if not self.body:
            return replace(self.prior, config=config)
        own = {name: value for name, value in values.items() if value.ndim}
        each: list[dict[str, Any]] = [
            {name: float(value[body]) for name, value in own.items()} for body in range(self.bodies)
        ]
        return replace(self.prior, config=config, each=tuple(replace(config, **e) for e in each))

    def believing(
        self,
        place: Float[ndarray, "D"],
        covariance: Float[ndarray, "D D"],
        own: Float[ndarray, "D D"] | None = None,
    ) -> Self:
        """Return this kind with another vector z as the most likely one."""
        return replace(self, prior=self.at(place), covariance=covariance, own=own)

    @property
    def bodies(self) -> int:
        """The number of bodies with values of their own; 1: all have the same."""
        return 1 + max(self.body, default=0)

    def of_scene(self, bodies: int) -> "Kind":
        """Return this kind where each of so many bodies has values of its own.

        Its vectors z begin with the parameters of this kind, with the values of body 0. Those of
        bodies 1 and on follow.
        """
        several = bodies > 1 and any(one.scope == "body" for one in self.parameters)
        return _of_scene(self, bodies) if several else self

    @cached_property
    def design(self) -> Float[ndarray, "E D"]:
        """The matrix of zeros and ones that makes vectors z of a scene from those of the kind."""
        names = self.names[: sum(body <= 0 for body in self.body)] if self.body else self.names
        return np.array([[float(one == name) for name in names] for one in self.names])

    def step(self, bodies: Bodies, scenes: Scenes, pushes: Pushes, values: Values | None) -> Scenes:
        """Predict pushes, each with values of its own of some parameters."""
        if self.body and values:  # a scene may have fewer bodies
            values = {n: v[:, : scenes.shape[1]] if v.ndim == 2 else v for n, v in values.items()}
        return step_knowing(self.prior.with_bodies(bodies), scenes, pushes, values)

    def inferring(self, *names: str) -> Self:
        """Return this kind where pushes also show the parameters of these names."""
        new = [name for name in names if name not in self.names]
        if not new or not self.names:
            return self
        count = len(self.names)
        covariance = np.eye(count + len(new))
        covariance[:count, :count] = self.covariance
        own = self.own
        if own is not None:
            own = np.pad(own, (0, len(new))) + np.diag([*np.zeros(count), *np.diag(_own(new))])
        return replace(self, names=(*self.names, *new), covariance=covariance, own=own)

    def settled(self) -> Self:
        """Return this kind where an episode's pushes show what has a grid alone.

        So it is once many pushes have shown all else.
        """
        columns = [self.names.index(name) for name in self.on_grid]
        covariance = self.covariance[np.ix_(columns, columns)]
        return replace(self, names=tuple(self.on_grid), covariance=covariance, own=None)


@lru_cache(256)
def _of_scene(kind: Kind, bodies: int) -> Kind:
    """Return a kind of a scene; kept, since what pushes show is kept with it."""
    scopes = [one.scope for one in kind.parameters]
    of_body = [column for column, scope in enumerate(scopes) if scope == "body"]
    columns = [*range(len(scopes)), *of_body * (bodies - 1)]
    first = [0 if scope == "body" else SHARED for scope in scopes]
    body = (*first, *np.repeat(range(1, bodies), len(of_body)).tolist())
    own = kind.own
    if own is None:
        own = np.zeros_like(kind.covariance)
        block = np.ix_(of_body, of_body)
        own[block] = OWN["body"] * np.linalg.inv(kind.precision[block])
    wide, same = np.ix_(columns, columns), np.equal.outer(body, body)
    covariance = (kind.covariance - own)[wide] + same * own[wide]
    names = tuple(kind.names[column] for column in columns)
    return replace(kind, names=names, covariance=covariance, own=None, body=body)


@dataclass(frozen=True, eq=False)
class KnownBody:
    """A body that was recorded: what is believed of it where it is pushed next, and R pushes.

    Errors are a share of the way, one of `SHARES`. Those on one surface are correlated with those
    on another, by one of `CORRELATIONS`.
    """

    name: str  # as its user calls it
    shape: str  # by which it is found
    kind: Kind
    state: Float[ndarray, "R 8"]
    action: Float[ndarray, "R A"]
    next_state: Float[ndarray, "R 8"]
    surface: Int[ndarray, "R"]  # number of the surface of each push; 0: where it is pushed next
    surfaces: tuple[dict[str, float], ...]  # values of the physics on each, by name
    log_odds: Float[ndarray, "S C"]  # of each share and correlation, from all recorded bodies

    @property
    def arrays(self) -> tuple[ndarray, ndarray, ndarray]:
        """Scenes (R, 1, 8) before, pushes (R, A) and scenes after."""
        return self.state[:, None], self.action, self.next_state[:, None]

    @property
    def values(self) -> dict[str, Scalars]:
        """The values of the physics of each push, (R,) by name."""
        names = self.surfaces[-1]
        tables = {name: np.array([one[name] for one in self.surfaces]) for name in names}
        return {name: table[self.surface] for name, table in tables.items()}


SHARES: Final = np.array([0.0, 0.02, 0.04, 0.08, 0.16])  # size of errors, share of the way
CORRELATIONS: Final = np.array([0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of the physics before an episode's first push."""

    kinds: tuple[Kind, ...]  # of physics; that with the network is the first
    network_log_odds: float = KEEP  # logarithm of the odds that the network's correction holds
    # where this comes from; empty: no laboratory was recorded
    card: dict[str, Any] = field(default_factory=dict)
    bodies: tuple[KnownBody, ...] = ()

    def known(self, bodies: Bodies) -> dict[int, KnownBody]:
        """Return which bodies of a scene were recorded, by their numbers: those of one shape."""
        shapes = [one.shape for one in self.bodies]
        return {
            number: self.bodies[shapes.index(shape.name)]
            for number, shape in enumerate(bodies.shapes)
            if shapes.count(shape.name) == 1
        }

    def about(self, bodies: Bodies) -> Self:
        """Return what is believed of these bodies: of a lone one that was recorded, its own."""
        known = self.known(bodies)
        if len(bodies) > 1 or not known:
            return self
        return replace(self, kinds=(known[0].kind, *self.kinds))

    def of_scene(self, bodies: int) -> Self:
        """Return this belief where each of so many bodies has values of its own."""
        kinds = tuple(kind.of_scene(bodies) for kind in self.kinds)
        return self if kinds == self.kinds else replace(self, kinds=kinds)

    @property
    def likeliest(self) -> Kind:
        """The most likely kind, the first of equals."""
        return max(self.kinds, key=lambda kind: kind.log_odds)

    @property
    def trained(self) -> Kind:
        """The kind that the network was trained on."""
        return next(kind for kind in self.kinds if kind.corrected)

    def with_unknown_masses(self) -> Self:
        """Return this belief where masses are not measured: pushes show their ratio."""
        return replace(self, kinds=tuple(kind.inferring(MASS_RATIO) for kind in self.kinds))


def surface_kind() -> Kind:
    """Return the textbook's physics of bodies with flat bottoms, before any push."""
    prior, names = PlanarPrior(replace(TEXTBOOK, tool_friction=0.2)), BODY_ON_SURFACE
    return Kind("flat", prior, names, np.eye(len(names)), of_bodies=True)


def friction_kind(prior: Model, infers: bool = True, deviation: float = 1.0) -> Kind:
    """Return a kind of physics of which pushes show the friction at most, if the prior is planar.

    `deviation` is that of the friction's z before any push.
    """
    if not infers or not isinstance(prior, PlanarPrior):
        return Kind("given", prior, (), np.zeros((0, 0)), corrected=True)
    return Kind("planar", prior, covariance=np.full((1, 1), deviation**2), corrected=True)


def friction_belief(prior: Model) -> Belief:
    """Return the belief of one kind of physics, of which pushes show the friction at most."""
    return only(friction_kind(prior))


def only(kind: Kind) -> Belief:
    """Return the belief of one kind of physics, on which a network's correction always holds.

    For a body that it did not learn from, its own pushes have to show it.
    """
    return Belief((kind,), OF_NEW if kind.of_bodies else np.inf)


def default_belief(prior: PlanarPrior) -> Belief:
    """Return what is believed without recordings: a network's own prior, or the textbook's.

    The textbook's is fitted to nothing. Pushes show all parameters of both. A prior with the axes
    of an engine's solver is likely for bodies on feet, which only simulators have, and unlikely
    for those that lie flat. Of these, each has its own values on its surface (`surface_kind`).
    """
    axes = prior.config.has_axes
    names = (*LABORATORY, ALONG_AXES if axes else ACROSS)
    textbook = replace(TEXTBOOK, friction=prior.config.friction)
    first = unknown(SOLVER_AXES, prior, names)
    first = replace(first, log_odds=TRAINED, flat_log_odds=-2.0 * TRAINED, corrected=True)
    if not axes:
        first = replace(first, name=FITTED, flat_log_odds=0.0)
    other = PlanarPrior(textbook, prior.bodies)
    surface = surface_kind()
    lying = PlanarPrior(replace(surface.config, friction=prior.config.friction), prior.bodies)
    flat = replace(
        unknown(surface.name, lying, (FRICTION, *surface.names)),  # friction: of fast pushes
        log_odds=TRAINED,
        only_flat=True,
        of_bodies=True,
    )
    return Belief((first, unknown(NO_AXES, other, (*LABORATORY, ACROSS)), flat))


def unknown(name: str, prior: Model, names: tuple[str, ...]) -> Kind:
    """Return a kind of physics of bodies of which nothing was measured."""
    wide = np.diag([WIDE.get(name, 1.0) ** 2 for name in names])
    return Kind(name, prior, names, wide, own=_own(names) * wide)


def _own(names: Sequence[str]) -> Float[ndarray, "D D"]:
    """Return what is of each body of parameters whose variance is 1."""
    parameters = [BY_NAME[name] for name in names]
    return np.diag([one.scope == "body" and own_share(one) for one in parameters]).astype(float)


def own_share(parameter: Parameter) -> float:
    """Return the share of a parameter's variance that is of the episode, or of each body."""
    return OWN.get(parameter.name, OWN[parameter.scope])


def corrected_belief(prior: PlanarPrior) -> Belief:
    """Return the default belief, all kinds of which a network has learned to correct."""
    belief = default_belief(prior)
    return replace(belief, kinds=tuple(replace(kind, corrected=True) for kind in belief.kinds))


def laboratory_kinds(belief: Belief, flat: bool) -> list[Kind]:
    """Return the kinds that the pushes of a laboratory, where all bodies lie flat or not, show.

    They have all parameters that many pushes show, which all episodes share.
    """
    shared = [replace(kind, of_bodies=False) for kind in belief.kinds]
    if flat:
        shared = [kind for kind in shared if not kind.has_axes]
        more = (*OF_TABLE, "disk_friction", "inertia", "speed_factor")
        return [kind.inferring(*(more if kind.only_flat else OF_TABLE)) for kind in shared]
    return [kind.inferring(*OF_TABLE) for kind in shared if not kind.only_flat]


def _value(parameter: Parameter, base: float, z: Float[ndarray, "R"]) -> Scalars:
    away = parameter.spread * z
    value = base * np.exp(away) if parameter.logarithm else base + away
    return np.clip(value, parameter.least, parameter.most)


COMMAND: Final = "ros2 run sain_model identify"


def write_belief(path: Path, belief: Belief) -> Path:
    """Write a belief; raises `OutputError`."""
    content = {
        "format": FORMAT,
        **belief.card,
        "network_log_odds": belief.network_log_odds,
        "kinds": [written_kind(kind) for kind in belief.kinds],
        "known": [_written_body(body) for body in belief.bodies],
    }
    return write_json(path, content)


def read_belief(path: Path) -> Belief:
    """Read a belief.

    Raises `CheckpointError`: no such file, not a belief, or one of an earlier version.
    """
    try:
        content = read_json(path)
        if not isinstance(content, dict) or "format" not in content:
            raise ValueError("it is no belief")
        if wrong := other_format(content.pop("format")):
            raise ValueError(f"it {wrong}")
        kinds = tuple(read_kind(part) for part in content.pop("kinds"))
        bodies = tuple(_read_body(part) for part in content.pop("known"))
        odds = float(content.pop("network_log_odds"))
        if np.isnan(odds):
            raise ValueError("network_log_odds is NaN")
        if not any(kind.corrected for kind in kinds):
            raise ValueError("no kind of physics is that of the network")
    except FileNotFoundError:
        raise CheckpointError(f"belief {path} does not exist; make it with: {COMMAND}") from None
    except (OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise CheckpointError(
            f"belief {path} cannot be read: {error}; make it again with: {COMMAND}"
        ) from error
    return Belief(kinds, odds, content, bodies)


def written_kind(kind: Kind) -> dict[str, Any]:
    """Return a kind of physics as JSON has it."""
    parameters = [
        {
            "name": name,
            "meaning": BY_NAME[name].meaning,
            "mean": mean,
            "spread": spread,
            "spread_is": "of the logarithm" if BY_NAME[name].logarithm else "of the value",
        }
        for name, (mean, spread) in kind.stated.items()
    ]
    return {
        "name": kind.name,
        "log_odds": kind.log_odds,
        "corrected": kind.corrected,
        "of_bodies": kind.of_bodies,
        "parameters": parameters,
        "config": asdict(kind.config),
        "covariance": kind.covariance.tolist(),
        "own": None if kind.own is None else kind.own.tolist(),
    }


def read_kind(part: dict[str, Any]) -> Kind:
    """Return a kind that `written_kind` wrote; raises what damaged values raise."""
    names = tuple(str(parameter["name"]) for parameter in part["parameters"])
    if unknown := [name for name in names if name not in BY_NAME]:
        raise ValueError(f"there is no parameter {unknown[0]!r}")
    covariance = np.array(part["covariance"], dtype=np.float64)
    right = len(names), len(names)
    if covariance.shape != right or not np.isfinite(covariance).all():
        raise ValueError(f"a covariance has shape {covariance.shape}; allowed: {right}, finite")
    if np.linalg.eigvalsh(covariance)[0] <= 0.0 or not np.allclose(covariance, covariance.T):
        raise ValueError("a covariance is not symmetric and positive")
    config = PlanarConfig(**typed_settings(PlanarConfig, part["config"]))
    odds, corrected = float(part["log_odds"]), bool(part["corrected"])
    if not np.isfinite(odds):
        raise ValueError(f"log_odds of a kind of physics is {odds}; it must be finite")
    of_bodies = bool(part.get("of_bodies", False))
    prior = PlanarPrior(config)
    own = None if part["own"] is None else np.array(part["own"], dtype=np.float64)
    if own is not None and (own.shape != right or np.linalg.eigvalsh(covariance - own)[0] < -1e-9):
        raise ValueError("what bodies have of their own is no part of a covariance")
    kind = Kind(str(part["name"]), prior, names, covariance, odds, corrected=corrected)
    return replace(kind, of_bodies=of_bodies, own=own)


ROWS: Final = ("state", "action", "next_state", "surface", "log_odds")  # arrays of a `KnownBody`


def _written_body(body: KnownBody) -> dict[str, Any]:
    """Return a recorded body as JSON has it."""
    written = {name: getattr(body, name) for name in ("name", "shape", "surfaces")}
    return {
        **written,
        "kind": written_kind(body.kind),
        **{n: getattr(body, n).tolist() for n in ROWS},
    }


def _read_body(part: dict[str, Any]) -> KnownBody:
    """Return a body that `_written_body` wrote; raises what damaged values raise."""
    rows = {name: np.array(part[name]) for name in ROWS}
    count, size = len(rows["surface"]), len(rows["action"][0])
    right: dict[str, tuple[int, ...]] = dict.fromkeys(ROWS, (count, STATE_SIZE))
    right |= {"action": (count, size), "surface": (count,)}
    right["log_odds"] = len(SHARES), len(CORRELATIONS)
    for name, array in rows.items():
        kinds = "i" if name == "surface" else "if"
        if array.shape != right[name] or array.dtype.kind not in kinds:
            raise ValueError(
                f"{name} of a body is {array.dtype} of shape {array.shape}; allowed: numbers of"
                f" shape {right[name]}"
            )
        if not np.isfinite(array).all():
            raise ValueError(f"{name} of a body holds NaN or Inf")
    surfaces = tuple({str(n): float(v) for n, v in one.items()} for one in part["surfaces"])
    if not 0 <= rows["surface"].min() <= rows["surface"].max() < len(surfaces):
        raise ValueError("a push of a body is on a surface that is not there")
    kind = replace(read_kind(part["kind"]), corrected=True)
    for one in surfaces:
        if one.keys() != set(kind.names):
            raise ValueError(f"values of a body are of {[*one]}; allowed: {[*kind.names]}")
        check_values({name: np.array([value]) for name, value in one.items()}, 1, 1)
    return KnownBody(str(part["name"]), str(part["shape"]), kind, **rows, surfaces=surfaces)
