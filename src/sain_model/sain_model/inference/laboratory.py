"""Kinds of physics fitted to the recordings of a laboratory, which have to agree.

All episodes share the parameters, but for those of which each has its own. What is compared between
recordings are the kind of physics and the frictions: other parameters make up for each other, and
another choice of bodies or pushes moves them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, Final

import numpy as np

from sain_core.errors import DatasetError
from sain_model.inference.evidence import Known, ObservedPushes, curves_of, marginals
from sain_model.inference.gauss_newton import Fit, Parts, fit
from sain_model.inference.kinds import FRICTION, Belief, Kind, Places

STEPS: Final = 25
MOST_ODDS: Final = 20.0  # logarithm: recordings may not rule out for ever what they do not show
FEW_BODIES: Final = 4  # fewer do not show how far bodies differ
LEAST_SPREAD: Final = 0.1  # of z: over episodes, and of what they share

FRICTIONS: Final = (FRICTION, "tool_friction", "disk_friction")  # that have to agree
CERTAIN_OF_KIND: Final = 20.0  # logarithm of the evidence
CERTAIN: Final = 5.0  # standard deviations of a difference that is no chance
LARGE: Final = 0.3  # [spreads], smaller differences of parameters do not matter
LARGE_FRICTION: Final = 0.1  # [spreads], of a friction that all episodes of a recording share
SHARED: Final = 0.1  # [spreads], less scatter over episodes means that they share the friction

Recordings = Mapping[str, Parts]


def count_episodes(parts: Parts) -> int:
    """Return the number of episodes of all parts together."""
    return 1 + max(int(part.episode.max()) for part in parts)


def shifted(parts: Parts, by: int) -> list[ObservedPushes]:
    """Return the same pushes with other numbers of episodes."""
    return [part.in_episodes(part.episode + by) for part in parts]


def fit_recordings(kinds: Sequence[Kind], recordings: Recordings) -> list[Fit]:
    """Return fits of each kind to recordings by name, whose episodes are counted as one sequence.

    Raises:
        DatasetError: two recordings disagree about the kind of physics or a friction.
    """
    pushes = [part for parts in recordings.values() for part in parts]
    fits = [fit_laboratory(kind, pushes) for kind in kinds]
    if len(recordings) > 1:
        alone = {
            name: [fit_laboratory(kind, _numbered_anew(parts)) for kind in kinds]
            for name, parts in recordings.items()
        }
        check_kinds(alone)
        best = fits.index(_best(fits))
        check_frictions({name: some[best] for name, some in alone.items()})
    return fits


def fit_laboratory(kind: Kind, parts: Parts) -> Fit:
    """Return the parameters that explain the pushes of a laboratory best."""
    count = count_episodes(parts)
    totals = sum(
        Known.of_episodes(part.episode, count).total(curves_of(kind, part)) for part in parts
    )
    start = marginals(kind, np.asarray(totals)).places
    shared = ~kind.of_episode
    start[:, shared] = start[:, shared].mean(axis=0)
    return fit(kind, parts, start, np.zeros(count, np.int64), STEPS)


def over_bodies(kind: Kind, parts: Parts) -> tuple[Kind, Places]:
    """Return a kind with what pushes of several bodies show of one that was not pushed yet.

    Also returned are the vectors z of these bodies, as the new kind has them.

    The mean and the spread over the bodies are those of the values that explain the pushes of
    each best (empirical Bayes). Of a few bodies only the mean counts.

    Args:
        kind: with what is believed before any push.
        parts: pushes, whose episodes are those of one body on one surface each.
    """
    count = count_episodes(parts)
    places = fit(kind, parts, np.zeros((count, len(kind.names))), np.arange(count), STEPS).places
    prior, away = kind.at(places.mean(axis=0)), places - places.mean(axis=0)
    if count < FEW_BODIES:
        return replace(kind, prior=prior), away
    scatter = np.hypot(places.std(axis=0, ddof=1), LEAST_SPREAD)
    covariance = np.diag(scatter**2) * (1.0 + 1.0 / count)
    return replace(kind, prior=prior, covariance=covariance), away


def identified(fits: Sequence[Fit], network_log_odds: float, recordings: Recordings) -> Belief:
    """Return the belief after a laboratory's recordings."""
    best = _evidence(_best(fits))
    odds = float(np.clip(network_log_odds, -MOST_ODDS, MOST_ODDS))
    return Belief(tuple(_kind(one, best) for one in fits), odds, _card(recordings, fits))


def _kind(found: Fit, best: float) -> Kind:
    kind, own = found.kind, found.kind.of_episode
    covariance = found.shared_covariance + LEAST_SPREAD**2 * np.eye(len(own))
    scatter = np.hypot(found.places.std(axis=0), LEAST_SPREAD)
    covariance[own, own] = scatter[own] ** 2
    return replace(
        kind,
        prior=kind.at(found.places.mean(axis=0)),
        covariance=covariance,
        log_odds=max(_evidence(found) - best, -MOST_ODDS),
        flat_log_odds=0.0,
    )


def _card(recordings: Recordings, fits: Sequence[Fit]) -> dict[str, Any]:
    return {
        "source": {name: sum(map(len, some)) for name, some in recordings.items()},
        "pushes": sum(len(part) for some in recordings.values() for part in some),
        "episodes": len(fits[0].places),
        "evidence": {one.kind.name: _evidence(one) for one in fits},
        "noise_factor": {one.kind.name: float(one.factor[0]) for one in fits},
    }


def check_kinds(fits: Mapping[str, Sequence[Fit]]) -> None:
    """Check what recordings, by name, say about the kind of physics; all have a fit of each kind.

    Raises:
        DatasetError: two are certain of different kinds; naming them.
    """
    for (name, first), (other, second) in combinations(fits.items(), 2):
        kinds = [_best(some).kind.name for some in (first, second)]
        gains = [
            _evidence(_best(some)) - _evidence(one)
            for some in (first, second)
            for one in some
            if one is not _best(some)
        ]
        if kinds[0] != kinds[1] and min(gains) > CERTAIN_OF_KIND:
            raise DatasetError(
                f"{name} and {other} disagree about the kind of physics: {kinds[0]} and"
                f" {kinds[1]}, by logarithms of evidence of at least {min(gains):.0f}; identify"
                " each laboratory by itself"
            )


def check_frictions(fits: Mapping[str, Fit]) -> None:
    """Check what recordings, by name, say about the frictions of one kind of physics.

    Raises:
        DatasetError: two disagree; naming them and the parameter that differs most.
    """
    worst, message = 1.0, ""
    for (name, first), (other, second) in combinations(fits.items(), 2):
        for parameter in (one for one in first.kind.parameters if one.name in FRICTIONS):
            column = first.kind.names.index(parameter.name)
            apart, deviation, large = _difference(first, second, column)
            ratio = min(apart / (CERTAIN * deviation), apart / large)
            if ratio > worst:
                means = np.stack([one.places.mean(axis=0) for one in (first, second)])
                values = first.kind.values(means)[parameter.name]
                worst, message = (
                    ratio,
                    (
                        f"{name} and {other} disagree about {parameter.name}"
                        f" ({parameter.meaning}): {values[0]:.3g} and {values[1]:.3g},"
                        f" {apart / deviation:.0f} standard deviations apart; identify each"
                        " laboratory by itself"
                    ),
                )
    if message:
        raise DatasetError(message)


def _difference(first: Fit, second: Fit, column: int) -> tuple[float, float, float]:
    """Return how far two values of z are apart, its standard deviation, and what is large."""
    some = [one.places[:, column] for one in (first, second)]
    apart = abs(float(some[0].mean() - some[1].mean()))
    if not first.kind.of_episode[column]:
        variance = sum(one.shared_covariance[column, column] for one in (first, second))
        return apart, float(np.sqrt(variance)), LARGE
    scatter = [float(values.std()) for values in some]
    variance = sum(max(s, SHARED) ** 2 / len(v) for s, v in zip(scatter, some, strict=True))
    return apart, float(np.sqrt(variance)), LARGE_FRICTION if max(scatter) < SHARED else 1.0


def _best(fits: Sequence[Fit]) -> Fit:
    return max(fits, key=_evidence)


def _evidence(found: Fit) -> float:
    return float(found.log_evidence[0])


def _numbered_anew(parts: Parts) -> list[ObservedPushes]:
    return shifted(parts, -min(int(part.episode.min()) for part in parts))
