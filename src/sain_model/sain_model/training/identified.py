"""Physics that ``sain_model identify`` found, as the prior of a network."""

from dataclasses import replace
from pathlib import Path

from sain_core.errors import ConfigError
from sain_model.dynamics.settings import PLANAR, PLANAR_AXES
from sain_model.identification.belief_file import read_belief
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior
from sain_model.training.settings import NOTHING, TrainingConfig

IdentifiedPhysics = tuple[PlanarPrior, FrictionFilter | None]


def identified_physics(
    path: Path, config: TrainingConfig
) -> tuple[TrainingConfig, IdentifiedPhysics]:
    """Return the most likely physics of a belief, and settings that name it.

    A checkpoint on it infers friction alone, as in its training: the recordings tell the rest.

    Raises:
        CheckpointError: no such file, or not a belief.
        ConfigError: the settings ask for another prior.
    """
    structure = read_belief(path).likeliest
    name = PLANAR_AXES if structure.config.has_axes else PLANAR
    if config.prior not in (PLANAR, name):
        raise ConfigError(
            f"--prior is {config.prior!r}; the physics of {path} is a {name!r}: leave --prior out"
        )
    prior = PlanarPrior(structure.config)
    friction = None if config.history == NOTHING else prior.filter(structure.friction)
    return replace(config, prior=name), (prior, friction)
