"""Learns a belief from the recordings of a laboratory, for a model that begins with one."""

from dataclasses import replace

import numpy as np

from sain_core.errors import ConfigError
from sain_model.data.bodies import infer_bodies, pushes_of_bodies
from sain_model.data.dataset import Dataset
from sain_model.dynamics.sain import Inferred, SainDynamics
from sain_model.inference.evidence import FACTORS, errors_of, log_density
from sain_model.inference.gauss_newton import Fit, Parts
from sain_model.inference.kinds import KEEP, Belief, default_belief, surface_kind
from sain_model.inference.laboratory import Recordings, fit_recordings, identified, over_bodies
from sain_model.inference.posterior import Posterior
from sain_model.physics.planar import PlanarPrior


def identify(model: SainDynamics, recordings: Recordings) -> Belief:
    """Return what the recordings of one laboratory say.

    Args:
        model: with a belief to begin with.
        recordings: by name; episodes of all are counted as one sequence.

    Raises:
        DatasetError: two recordings disagree about the kind of physics or a friction.
    """
    pushes = [part for parts in recordings.values() for part in parts]
    kinds = [kind for kind in model.belief.kinds if not kind.of_bodies]  # what all episodes share
    fits = fit_recordings(kinds, recordings)
    number = kinds.index(model.belief.trained)
    return identified(fits, _network_odds(model, number, fits[number], pushes), recordings)


def identify_bodies(data: Dataset) -> Belief:
    """Return what pushes of named bodies on surfaces show of a body that was not pushed yet.

    The card has the values of each of them.
    """
    over, start = over_bodies(surface_kind(), pushes_of_bodies(data)[1])
    kind = replace(over, corrected=True)
    places = infer_bodies(kind, data, start)
    values = kind.values(np.array(list(places.values())))
    bodies = {
        name: {one: float(value[row]) for one, value in values.items()}
        for row, name in enumerate(places)
    }
    card = {"pushes": len(data), "episodes": len(bodies), "bodies": bodies}
    return Belief((kind,), card=card)


def _network_odds(model: SainDynamics, number: int, found: Fit, parts: Parts) -> float:
    """Return by how much the network explains the pushes better than the physics alone."""
    odds = KEEP
    for part in parts:
        posterior = Posterior.at(model.belief, number, found.places[part.episode])
        rows = Inferred(posterior, np.ones(len(part), dtype=bool))
        both = model.with_bodies(part.bodies).step_rows(part.state, part.action, rows)
        plain, corrected = (
            log_density(errors_of(after, part.next_state), part.scales(FACTORS)).sum(axis=0).max()
            for after in both
        )
        odds += float(corrected - plain)
    return odds


def with_all_parameters(model: SainDynamics) -> SainDynamics:
    """Return a model whose belief is about kinds of physics and all of their parameters.

    Raises:
        ConfigError: it infers nothing from pushes.
    """
    kind = model.belief.trained
    if len(model.belief.kinds) > 1:
        return model
    if not kind.names or not isinstance(kind.prior, PlanarPrior) or model.network is None:
        raise ConfigError(f"the model on {model.origin.prior_name!r} infers nothing from pushes")
    return model.believing(default_belief(kind.prior))
