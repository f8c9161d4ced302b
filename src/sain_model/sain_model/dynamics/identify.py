"""Learns a belief from the recordings of a laboratory, for the shipped model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from sain_core.errors import ConfigError
from sain_core.types import Scenes
from sain_model.dynamics.sain import SainDynamics
from sain_model.identification.agreement import check_frictions, check_kinds
from sain_model.identification.beliefs import KEEP, Belief, usual_belief
from sain_model.identification.evidence import errors_of, log_density, scales_of
from sain_model.identification.fitting import step_at
from sain_model.identification.laboratory import (
    LaboratoryFit,
    RecordedPushes,
    fit_laboratory,
    shifted,
)
from sain_model.identification.parameters import FRICTION, config_at, mass_factor
from sain_model.identification.structures import Structure
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import with_mass_ratio

Recording = Sequence[RecordedPushes]
MOST_ODDS: Final = 20.0  # logarithm: recordings may not rule out for ever what they do not show
LEAST_SPREAD: Final = 0.1  # of z: of the friction of an episode, and of what is shared


def identify(model: SainDynamics, recordings: Mapping[str, Recording]) -> Belief:
    """Return what the recordings of one laboratory tell.

    Args:
        model: with a belief to begin with.
        recordings: by name; episodes of all are counted as one sequence.

    Raises:
        DatasetError: two recordings disagree about the kind of physics or a friction.
    """
    assert model.belief is not None
    pushes = [part for parts in recordings.values() for part in parts]
    fits = [fit_laboratory(structure, pushes) for structure in model.belief.structures]
    best = max(fits, key=lambda fit: fit.log_evidence)
    if len(recordings) > 1:
        alone = {
            name: [fit_laboratory(fit.structure, _numbered_anew(parts)) for fit in fits]
            for name, parts in recordings.items()
        }
        check_kinds(alone)
        check_frictions({name: some[fits.index(best)] for name, some in alone.items()})
    odds = _network_odds(model, next(f for f in fits if f.structure.corrected), pushes)
    structures = tuple(_identified(fit, best.log_evidence) for fit in fits)
    return Belief(structures, odds, _card(recordings, fits))


def _identified(fit: LaboratoryFit, best: float) -> Structure:
    """Return a structure at what was fitted."""
    unit = fit.structure.parameters[FRICTION].spread
    covariance = fit.covariance + LEAST_SPREAD**2 * np.eye(len(fit.covariance))
    scatter = np.hypot(fit.frictions.std(), LEAST_SPREAD)
    covariance[FRICTION, FRICTION] = scatter**2
    usual = fit.structure.friction
    return replace(
        fit.structure,
        config=config_at(fit.structure.config, fit.shared),
        covariance=covariance,
        friction=replace(usual, width=float(unit * scatter)),
        log_odds=max(fit.log_evidence - best, -MOST_ODDS),
    )


def _network_odds(
    model: SainDynamics, fit: LaboratoryFit, parts: Sequence[RecordedPushes]
) -> float:
    """Return by how much the network explains the pushes better than the physics alone."""
    odds = KEEP
    for part in parts:
        places = np.tile(fit.shared, (len(part), 1))
        places[:, FRICTION] = fit.frictions[part.episode]
        physics_next = step_at(fit.structure, part.bodies, part, places)
        scenes = with_mass_ratio(part.state, mass_factor(places))
        corrected = model.with_bodies(part.bodies).network_correct(
            scenes, part.action, physics_next
        )
        odds += _density(part, corrected) - _density(part, physics_next)
    return float(np.clip(odds, -MOST_ODDS, MOST_ODDS))


def _density(part: RecordedPushes, predicted: Scenes) -> float:
    errors, scale = errors_of(predicted, part.next_state), scales_of(part, part.bodies)
    return float(log_density(errors, scale).sum(axis=0).max())


def _numbered_anew(parts: Recording) -> list[RecordedPushes]:
    first = min(int(part.episode.min()) for part in parts)
    return shifted(parts, -first)


def _card(recordings: Mapping[str, Recording], fits: Sequence[LaboratoryFit]) -> dict[str, Any]:
    parts = [part for some in recordings.values() for part in some]
    return {
        "source": {name: sum(map(len, some)) for name, some in recordings.items()},
        "pushes": sum(map(len, parts)),
        "episodes": len(fits[0].frictions),
        "evidence": {fit.structure.name: fit.log_evidence for fit in fits},
        "noise_factor": {fit.structure.name: fit.factor for fit in fits},
    }


def believing_model(model: SainDynamics) -> SainDynamics:
    """Return a model with a belief to begin with: its own, or what is usual for its prior.

    Raises:
        ConfigError: it infers nothing from pushes.
    """
    if model.belief is not None:
        return model
    if model.friction is None or not isinstance(model.prior, PlanarPrior):
        raise ConfigError(f"the model on {model.prior_name!r} infers nothing from pushes")
    return model.with_prior_belief(usual_belief(model.prior.config, model.friction))
