"""Bodies on surfaces, in data sets that state both: each has values of its own of the physics."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_model.data.dataset import Dataset, Part
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Kind, Places
from sain_model.inference.laboratory import STEPS

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
