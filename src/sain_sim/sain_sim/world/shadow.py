"""The shadow world: Bullet's own prediction of a push, f_p(s, a) of the paper (section III-B).

The tool moves in the shadow as it does in the truth: its way comes from the scene's own radii,
not from the shadow's. Where a shadow's disks are larger than the scene's,

* touching disks would overlap: they are first moved apart along the line of centres, and what
  is predicted is the scene's own pose plus the motion seen in the shadow;
* the mid disk could reach into the tool: the tool then starts further back on its line. With
  the paper's ranges its clearance of 5 mm is just enough, and it never has to.

The size of bodies that are no disks is part of their shape. A shadow of such bodies has the radii
of the scene, and only masses and friction are nominal.

As dynamics that other packages find by name, it is ``bullet`` (the paper's f_p: nominal masses,
radii and friction) and ``bullet_measured`` (masses and radii of the scene, nominal friction). Each
name that is asked for builds a world of its own, which `close` lets go of. All bodies are disks on
three feet: a scene does not state shapes.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from sain_core.errors import ConfigError, UnreachableError
from sain_core.feasibility import Stroke
from sain_core.model import Model
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import (
    MID,
    NOMINAL_MASS,
    POSE,
    POSITION,
    RADIUS,
    THETA,
    VELOCITY,
    move_apart,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_core.world import ToppledError
from sain_sim.world.engines import DEFAULT_ENGINE
from sain_sim.world.parameters import WorldParameters, nominal_parameters
from sain_sim.world.workcell import Closeable
from sain_sim.world.world import World, WorldConfig

NOMINAL: Final = "nominal"  # the paper's: nominal mass, radius and friction
MEASURED: Final = "measured"  # mass and radius of the scene, nominal friction
TRUE: Final = "true"  # all parameters of the truth: what is left is the repeatability floor
KINDS: Final = (NOMINAL, MEASURED, TRUE)
DYNAMICS: Final = {"bullet": NOMINAL, "bullet_measured": MEASURED}


class BulletPrior(Model, Closeable):
    """A `Model` that sets a world to a scene and pushes.

    Attributes:
        kind: one of `KINDS`.
        truth: the parameters of the truth; None: disks.
    """

    def __init__(
        self,
        kind: str = NOMINAL,
        config: WorldConfig = WorldConfig(),
        parameters: WorldParameters | None = None,
        engine: str = DEFAULT_ENGINE,
    ) -> None:
        """Build the shadow world.

        Args:
            kind: one of `KINDS`.
            config: how the shadow world is run.
            parameters: the truth's; needed by "true", and its shapes are used by all kinds.
            engine: the default one, or for a repeatability floor that of the truth.

        Raises:
            ConfigError: a kind that does not exist, or "true" without parameters.
        """
        if kind not in KINDS:
            raise ConfigError(f"kind of shadow is {kind!r}; allowed: {', '.join(KINDS)}")
        if kind == TRUE and parameters is None:
            raise ConfigError('a shadow of kind "true" needs the parameters of the truth')
        self.kind = kind
        self.truth = parameters
        self._world = World(nominal_parameters(), config, engine=engine)

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 5) from scenes (B, N, 8).

        Raises:
            UnreachableError: a push that the arm cannot carry out.
        """
        predicted = np.empty_like(scenes)
        for index in np.ndindex(pushes.shape[:-1]):
            predicted[index] = self.predict(scenes[index], pushes[index])
        return predicted

    def predict(self, scene: Scene, push: PushArray) -> Scene:
        """Predict the settled scene (N, 8) after one push (5,) from a scene (N, 8)."""
        if push[LENGTH] == 0.0:
            return scene.copy()
        bodies = PAPER_DISKS if self.truth is None else self.truth.bodies
        plain = bodies.stand_in_for_disks and bodies.shapes[0].is_round
        parameters = self._parameters(scene, plain)
        start = parameters.scene(scene[:, POSITION], scene[:, THETA])
        limits = self._world.config.feasibility.limits
        stroke = Stroke.of_push(scene, push, limits, bodies)
        if plain and self.kind != TRUE:
            start = move_apart(start)
        if plain:
            stroke = stand_back(stroke, start, limits)
        self._world.load(start, parameters)
        after = self._world.carry_out(stroke, guarded=False).after
        predicted = scene.copy()
        predicted[:, POSE] += after[:, POSE] - start[:, POSE]
        predicted[:, THETA] = wrap_angle(predicted[:, THETA])
        predicted[:, VELOCITY] = after[:, VELOCITY]
        return predicted

    def _parameters(self, scene: Scene, plain: bool) -> WorldParameters:
        truth = self.truth
        if self.kind == TRUE and truth is not None:  # with another draw of the noise
            return replace(truth, roughness=replace(truth.roughness, repeat=1))
        if self.kind == NOMINAL and plain:
            made = nominal_parameters(len(scene))
        else:
            made = WorldParameters.of_scene(scene)
            if self.kind == NOMINAL:
                made = replace(made, masses=(NOMINAL_MASS,) * len(scene))
        if truth is None:
            return made
        return replace(made, shapes=truth.shapes, roles=truth.roles)

    def close(self) -> None:
        """Close the shadow world."""
        self._world.close()


class Bullet(BulletPrior):
    """A shadow that goes on where its arm cannot: after predictions, not after what was seen.

    In a scene that was predicted the mid disk may stand where the arm does not reach. A world
    refuses such a push, as one that tips a body over, and nothing moves: so it is predicted, and
    counted.
    """

    _refused = 0

    @property
    def refused(self) -> int:
        """How many pushes the arm could not carry out so far."""
        return self._refused

    def predict(self, scene: Scene, push: PushArray) -> Scene:
        """Predict the settled scene (N, 8) after one push (5,) from a scene (N, 8)."""
        try:
            return super().predict(scene, push)
        except (UnreachableError, ToppledError):
            self._refused += 1
            return scene.copy()


def load_bullet(name: str) -> Bullet:
    """Return Bullet by one of its names.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in DYNAMICS:
        raise ConfigError(f"no dynamics {name!r} in the simulator; allowed: {', '.join(DYNAMICS)}")
    return Bullet(DYNAMICS[name])


def stand_back(stroke: Stroke, scene: Scene, limits: PushLimits) -> Stroke:
    """Return the stroke, begun further back on its line where the mid disk is in the tool."""
    way = unit(np.asarray(stroke.heading))
    offset = scene[MID, POSITION] - stroke.start
    wanted = scene[MID, RADIUS] + limits.tool_radius
    if np.hypot(*offset) >= wanted:
        return stroke
    along = float(offset @ way)
    across = float(offset @ offset) - along**2
    back = np.sqrt(wanted**2 - across) - along  # to where the tool just touches
    return stroke.from_further_back(float(back))
