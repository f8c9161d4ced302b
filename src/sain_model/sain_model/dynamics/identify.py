"""What recordings of a laboratory, or of bodies on surfaces, say of the physics."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError, DatasetError
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import Column, Columns, row_bodies
from sain_model.data.dataset import Dataset, Part, shard_paths
from sain_model.data.shard import read_shard
from sain_model.dynamics.sain import Inferred, SainDynamics
from sain_model.inference.evidence import FACTORS, ObservedPushes, errors_of, log_density
from sain_model.inference.gauss_newton import Fit, Parts, fit
from sain_model.inference.kinds import KEEP, Belief, Kind, Places, default_belief, surface_kind
from sain_model.inference.laboratory import (
    STEPS,
    Recordings,
    count_episodes,
    fit_recordings,
    identified,
    over_bodies,
)
from sain_model.inference.posterior import Posterior
from sain_model.physics.planar import PlanarPrior

ENOUGH: Final = 250  # pushes of a body that its values are inferred from: more change nothing

OfBodies = Mapping[str, Float[ndarray, "D"]]  # vectors z by the names of bodies on surfaces


def states_bodies(data: Dataset) -> bool:
    """Return whether all pushes are of one body that is named, as a robot's recordings are."""
    return all(part.object is not None and (part.object != "").all() for part in data.parts)


def body_names(part: Part) -> ndarray:
    """Return the name of the body on its surface of each push, (M,).

    Raises:
        DatasetError: the data do not name bodies.
    """
    if part.object is None or (part.object == "").any():
        raise DatasetError(
            "the data set does not name the pushed bodies: it has no column object, or empty rows"
        )
    surface = np.full(len(part), "") if part.surface is None else part.surface
    return on_surfaces(part.object, surface)


def on_surfaces(bodies: ndarray, surfaces: ndarray) -> ndarray:
    """Return names of bodies (M,) with those of their surfaces (M,); empty: it is not stated."""
    pairs = zip(bodies.tolist(), surfaces.tolist(), strict=True)
    return np.array([f"{body} on {table}" if table else body for body, table in pairs])


def pushes_of_bodies(data: Dataset, most: int = ENOUGH) -> tuple[list[str], list[ObservedPushes]]:
    """Return the names of bodies, and up to so many pushes of each, evenly from all of them.

    Episodes count the names.
    """
    each = [body_names(part) for part in data.parts]
    names = np.unique(np.concatenate(each))
    found = []
    for part, own in zip(data.parts, each, strict=True):
        body, chosen = np.searchsorted(names, own), np.zeros(len(part), bool)
        for one in np.unique(body):
            rows = np.flatnonzero(body == one)
            places = np.linspace(0, len(rows) - 1, min(most, len(rows)))
            chosen[rows[places.round().astype(int)]] = True
        found.append(part.observed.in_episodes(body).select(chosen))
    return names.tolist(), found


def infer_bodies(kind: Kind, data: Dataset, start: Places | None = None) -> OfBodies:
    """Return the most likely vectors z of the bodies of a data set.

    The search starts from vectors z of these bodies in the order of their names; None: from 0.
    """
    if not len(data):
        return {}
    names, pushes = pushes_of_bodies(data)
    first = np.zeros((len(names), len(kind.names))) if start is None else start
    found = fit(kind, pushes, first, np.arange(len(names)), STEPS)
    return dict(zip(names, found.places, strict=True))


def with_beliefs(data: Dataset, kind: Kind, bodies: OfBodies) -> Dataset:
    """Return a data set that states what is believed of each body: for those unknown, the mean."""
    parts = (
        replace(part, given=kind.values(believed_places(part, kind, bodies))) for part in data.parts
    )
    return replace(data, parts=tuple(parts))


def believed_places(part: Part, kind: Kind, bodies: OfBodies) -> Float[ndarray, "M D"]:
    """Return the vector z of the body of each push: for those unknown, the mean."""
    nothing = np.zeros(len(kind.names))
    places = [bodies.get(name, nothing) for name in body_names(part)]
    return np.array(places).reshape(len(part), len(kind.names))


def load_recording(path: Path) -> list[ObservedPushes]:
    """Return the pushes of a shard, or of all shards of a folder, by the bodies of the scenes.

    Pushes and strokes are apart.

    Episodes are counted from 0.

    Raises:
        DatasetError: see `read_shard`; or the path holds no shards.
    """
    found: dict[tuple[Bodies, int], list[Columns]] = {}
    for shard in shard_paths(path):
        columns = read_shard(shard)
        bodies = row_bodies(columns)
        for kind in dict.fromkeys(bodies):
            chosen = np.array([one == kind for one in bodies])
            part = {name: values[chosen] for name, values in columns.items()}
            found.setdefault((kind, part[Column.ACTION].shape[1]), []).append(part)
    episodes = np.unique(
        np.concatenate([part[Column.EPISODE] for parts in found.values() for part in parts])
    )
    return [_joined(parts, kind, episodes) for (kind, _), parts in found.items()]


def first_pushes(parts: Sequence[ObservedPushes], most: int) -> list[ObservedPushes]:
    """Return the pushes of the first whole episodes, as many as hold at most so many pushes."""
    counts = sum(np.bincount(part.episode, minlength=count_episodes(parts)) for part in parts)
    keep = int(np.searchsorted(np.cumsum(counts), most, side="right"))
    chosen = (part.select(part.episode < keep) for part in parts)
    return [part for part in chosen if len(part)]


def _rows(columns: Columns) -> int:
    return len(columns[Column.ACTION])


def _joined(parts: list[Columns], bodies: Bodies, episodes: np.ndarray) -> ObservedPushes:
    state, action, next_state, episode = (
        np.concatenate([part[name] for part in parts])
        for name in (Column.STATE, Column.ACTION, Column.NEXT_STATE, Column.EPISODE)
    )
    return ObservedPushes(state, action, next_state, np.searchsorted(episodes, episode), bodies)


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
