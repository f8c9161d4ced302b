"""How far predictions move with what is not known of the physics: friction, and masses."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.model import Model
from sain_core.scene import POSITION
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.physics.parameters import Values, known_friction
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import with_mass_ratio

Step = Callable[[Scenes, Pushes, Values | None], Scenes]


def physics_spread(
    step: Step,
    prior: Model,
    scenes: Scenes,
    pushes: Pushes,
    friction: Scalars | None,
    log_std: Scalars,
    mass_log_std: Scalars,
) -> Float[ndarray, "B N"]:
    """Return how far places move with one standard deviation [m].

    Args:
        step: predicts, with values of parameters or with what the prior has.
        prior: what is under it.
        scenes: settled scenes.
        pushes: one a scene.
        friction: with the table (B,); None: what the model believes.
        log_std: standard deviation of the friction's logarithm (B,).
        mass_log_std: of the logarithm of the ratio of masses (B,).
    """
    spread = np.zeros(scenes.shape[:2])
    if not isinstance(prior, PlanarPrior):
        return spread
    if log_std.any():
        usual = np.full(len(pushes), prior.config.friction) if friction is None else friction
        less, more = (
            step(scenes, pushes, {"friction": usual * np.exp(way * log_std)}) for way in (-1, 1)
        )
        spread = _half_way(less, more)
    if mass_log_std.any():
        less, more = (
            step(
                with_mass_ratio(scenes, np.exp(way * mass_log_std)),
                pushes,
                known_friction(friction),
            )
            for way in (-1, 1)
        )
        spread = np.hypot(spread, _half_way(less, more))
    return spread


def _half_way(less: Scenes, more: Scenes) -> Float[ndarray, "B N"]:
    return np.asarray(np.linalg.norm((more - less)[..., POSITION], axis=-1) / 2)
