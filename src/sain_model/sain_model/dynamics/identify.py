"""What recordings of a laboratory, or of bodies on surfaces, say of the physics.

What the episodes of a laboratory have in common is told apart from what each has of its own
(`sain_model.inference.episodes`). What is compared between recordings are the kind of physics and
the frictions: other parameters make up for each other, and another choice of bodies or pushes moves
them.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from operator import attrgetter
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError, DatasetError
from sain_core.scene import POSITION, RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import trace
from sain_core.shapes.shape import Shape
from sain_core.types import Mask
from sain_model.data.dataset import Dataset, Part
from sain_model.dynamics.sain import SainDynamics, recorded_errors
from sain_model.inference.episodes import Episodes
from sain_model.inference.evidence import (
    FACTORS,
    ObservedPushes,
    are_outliers,
    errors_of,
    log_density,
)
from sain_model.inference.kinds import (
    CORRELATIONS,
    FRICTION,
    KEEP,
    NO_AXES,
    SHARES,
    Belief,
    Kind,
    KnownBody,
    default_belief,
    laboratory_kinds,
    surface_kind,
)
from sain_model.inference.population import Pair, Population
from sain_model.inference.posterior import Parts, Posterior
from sain_model.physics.planar import PlanarPrior

STEPS: Final = 10  # of a fit of each episode
SWEEPS: Final = 8  # of fits of all episodes, each with what the others show
MOST_ODDS: Final = 20.0  # logarithm: recordings may not rule out for ever what they do not show

FRICTIONS: Final = (FRICTION, "tool_friction", "disk_friction")  # that have to agree
CERTAIN_OF_KIND: Final = 20.0  # logarithm of the evidence
CERTAIN: Final = 5.0  # standard deviations of a difference that is no chance
LARGE: Final = 0.3  # [spreads], smaller differences of parameters do not matter
LARGE_FRICTION: Final = 0.1  # [spreads], of a friction that all episodes of a recording share
SHARED: Final = 0.3  # [spreads], less scatter over episodes means that they share the friction

Recordings = Mapping[str, Parts]


def count_episodes(parts: Parts) -> int:
    """Return the number of episodes of all parts together."""
    return 1 + max((int(part.episode.max()) for part in parts), default=-1)


def joined(recordings: Recordings) -> list[ObservedPushes]:
    """Return the pushes of all recordings, their episodes counted as one sequence."""
    found: list[ObservedPushes] = []
    for parts in recordings.values():
        first = count_episodes(found)
        found += [replace(part, episode=part.episode + first) for part in parts]
    return found


def fit_recordings(kinds: Sequence[Kind], recordings: Recordings) -> list[Episodes]:
    """Return what all recordings together show of each kind.

    Raises `DatasetError`: two recordings disagree about the kind of physics or a friction.
    """
    fits = [fit_laboratory(kind, joined(recordings)) for kind in kinds]
    if len(recordings) > 1:
        best = fits.index(max(fits, key=_evidence))
        alone = {
            name: [fit_laboratory(kind, parts) for kind in kinds]
            for name, parts in recordings.items()
        }
        for pair in combinations(alone.items(), 2):
            _check_alike(dict(pair), best)
    return fits


def fit_laboratory(kind: Kind, parts: Parts) -> Episodes:
    """Return what the episodes of a laboratory show of a kind."""
    found, names = Episodes.before(kind), list(map(str, range(count_episodes(parts))))
    for _ in range(SWEEPS):
        found = found.learn(parts, names, STEPS)
    return found


def identified(model: SainDynamics, fits: Sequence[Episodes], recordings: Recordings) -> Belief:
    """Return the belief of a model after a laboratory's recordings."""
    best = max(fits, key=_evidence)
    odds = float(np.clip(_network_odds(model, best, joined(recordings)), -MOST_ODDS, MOST_ODDS))
    kinds = tuple(
        replace(one.next, log_odds=max(one.evidence - best.evidence, -MOST_ODDS), flat_log_odds=0.0)
        for one in fits
    )
    trained = model.belief.trained
    if trained.has_axes and not any(kind.has_axes for kind in kinds):  # of bodies that lie flat
        kinds = (replace(trained, log_odds=-MOST_ODDS), *kinds)
    return Belief(kinds, odds, _card(recordings, fits))


def _card(recordings: Recordings, fits: Sequence[Episodes]) -> dict[str, Any]:
    return {
        "source": {name: sum(map(len, some)) for name, some in recordings.items()},
        "pushes": sum(len(part) for some in recordings.values() for part in some),
        "episodes": len(fits[0].at),
        "evidence": {one.kind.name: one.evidence for one in fits},
    }


_evidence = attrgetter("evidence")


def _check_alike(fits: Mapping[str, Sequence[Episodes]], best: int) -> None:
    """Check what two recordings, by name, say of the kind of physics, and of frictions of the best.

    Raises `DatasetError`: they disagree; naming them and the parameter that differs most.
    """
    names, both = " and ".join(fits), list(fits.values())
    likeliest = [max(some, key=_evidence).kind.name for some in both]
    if likeliest[0] != likeliest[1]:
        leads = [np.diff(sorted(map(_evidence, some)))[-1] for some in both]
        if min(leads) > CERTAIN_OF_KIND:
            raise DatasetError(
                f"{names} disagree about the kind of physics: {' and '.join(likeliest)}, by"
                f" logarithms of evidence of at least {min(leads):.0f}; identify each laboratory"
                " by itself"
            )
    pair = [some[best] for some in both]
    kind, worst, message = pair[0].kind, 1.0, ""
    means = np.stack([one.mean for one in pair])
    for column, parameter in enumerate(kind.parameters):
        apart = abs(means[0, column] - means[1, column])
        deviation, large = _difference(pair, column)
        ratio = min(apart / (CERTAIN * deviation), apart / large)
        if parameter.name in FRICTIONS and ratio > worst:
            values, worst = kind.values(means)[parameter.name], ratio
            message = (
                f"{names} disagree about {parameter.name} ({parameter.meaning}):"
                f" {values[0]:.3g} and {values[1]:.3g}, {apart / deviation:.0f} standard"
                " deviations apart; identify each laboratory by itself"
            )
    if message:
        raise DatasetError(message)


def _difference(pair: Sequence[Episodes], column: int) -> tuple[float, float]:
    """Return the standard deviation of the difference of two values of z, and what is large."""
    deviation = float(np.sqrt(sum(one.covariance[column, column] for one in pair)))
    if pair[0].kind.parameters[column].scope != "episode":
        return deviation, LARGE
    scatter = max(float(np.sqrt(one.own[column])) for one in pair)
    return deviation, LARGE_FRICTION if scatter < SHARED else 1.0


RECALLED: Final = 64  # pushes of a body on a surface that are kept with a belief
DIGITS: Final = 7  # of metres and radians
ENOUGH: Final = 250  # pushes of a body that its values are inferred from: more change nothing
ANOTHER: Final = "another"  # a body or a surface of which nothing was pushed
UNLIKE: Final = -2.0  # logarithm of the odds that a new body is like the textbook's, not like these


def states_bodies(data: Dataset) -> bool:
    """Return whether all pushes are of one body that is named, as a robot's recordings are.

    Raises `DatasetError`: some are, and some are not.
    """
    named = [part.object is not None and (part.object != "").all() for part in data.parts]
    if any(named) and not all(named):
        raise DatasetError(
            "some of the pushes name their body (column object), and others do not; give the"
            " recordings of a robot, and those of a laboratory of many bodies, one by one"
        )
    return all(named)


def body_pairs(part: Part) -> list[Pair]:
    """Return the body of each push, and what it stood on, (M,).

    Raises `DatasetError`: the data do not name bodies.
    """
    if part.object is None or (part.object == "").any():
        raise DatasetError(
            "the data set does not name the pushed bodies: it has no column object, or empty rows"
        )
    surface = np.full(len(part), "") if part.surface is None else part.surface
    return list(map(Pair, part.object.tolist(), surface.tolist()))


def body_names(part: Part) -> ndarray:
    """Return the name of the body on its surface of each push, (M,); raises `DatasetError`."""
    return np.array(list(map(str, body_pairs(part))))


def pushes_of_bodies(data: Dataset, most: int = ENOUGH) -> dict[Pair, list[ObservedPushes]]:
    """Return up to so many pushes of each body, evenly from all of them, in the order of names."""
    found: dict[Pair, list[ObservedPushes]] = {}
    for part in data.parts:
        pairs = body_pairs(part)
        for pair in sorted(set(pairs)):
            rows = np.flatnonzero([other == pair for other in pairs])
            places = np.linspace(0, len(rows) - 1, min(most, len(rows)))
            pushes = part.alone.select(rows[places.round().astype(int)])
            found.setdefault(pair, []).append(pushes)
    return dict(sorted(found.items()))


def infer_bodies(kind: Kind, data: Dataset, most: int = ENOUGH) -> Population:
    """Return what up to so many pushes of each body of a data set show."""
    return Population.of(kind, pushes_of_bodies(data, most))


def next_surface(population: Population) -> str:
    """Return where bodies are pushed next: on the surface of all pushes, if it is one."""
    surfaces = {pair.surface for pair in population.shown}
    return surfaces.pop() if len(surfaces) == 1 else ANOTHER


def another(population: Population, surface: str = "") -> Kind:
    """Return what is believed of a body that was not pushed, on a surface."""
    return population.kind_of(Pair(ANOTHER, surface or next_surface(population)))


def known_bodies(population: Population, data: Dataset, surface: str) -> tuple[KnownBody, ...]:
    """Return the bodies of a data set, as they are pushed next, on a surface.

    All of them show how large errors are, and those that were pushed on two surfaces how errors on
    these are correlated.
    """
    pushes = pushes_of_bodies(data, RECALLED)
    odds, found = np.zeros((len(SHARES), len(CORRELATIONS))), list[KnownBody]()
    shapes = list[Shape]()
    for name in sorted({pair.body for pair in pushes}):
        own = [pair for pair in pushes if pair.body == name]
        outlines = {part.bodies.shapes[0].name for pair in own for part in pushes[pair]}
        if len(outlines) > 1:
            raise DatasetError(
                f"the body {name!r} has two outlines: {' and '.join(sorted(outlines))}; give each"
                " outline a name of its own (column object), and each body one outline"
            )
        places = [Pair(name, surface), *(pair for pair in own if pair.surface != surface)]
        z = np.stack([population.place(pair) for pair in places])
        values = population.kind.values(z)
        parts = [(places.index(pair), part) for pair in own for part in pushes[pair]]
        state, action, next_state = (
            np.concatenate([getattr(part, column).reshape(len(part), -1) for _, part in parts])
            for column in ("state", "action", "next_state")
        )
        shapes.append(parts[0][1].bodies.shapes[0])
        found.append(
            KnownBody(
                name,
                shapes[-1].name,
                replace(population.kind_of(places[0]), corrected=True, name=name),
                state.round(DIGITS),
                action.round(DIGITS),
                next_state.round(DIGITS),
                np.concatenate([np.full(len(part), number) for number, part in parts]),
                tuple({n: float(v[i]) for n, v in values.items()} for i in range(len(places))),
                odds,
            )
        )
    for body, shape in zip(found, shapes, strict=True):
        odds = odds + recorded_errors(body, shape).log_densities
    return tuple(replace(one, log_odds=odds) for one in found)


def with_beliefs(data: Dataset, population: Population) -> Dataset:
    """Return a data set that states what is believed of each body."""
    parts = (
        replace(part, given=population.kind.values(believed_places(part, population)))
        for part in data.parts
    )
    return replace(data, parts=tuple(parts))


def believed_places(part: Part, population: Population) -> Float[ndarray, "M D"]:
    """Return the vector z of the body of each push."""
    pairs = body_pairs(part)
    places = {pair: population.place(pair) for pair in set(pairs)}
    nothing = np.empty((0, len(population.kind.names)))
    return np.stack([places[pair] for pair in pairs]) if pairs else nothing


def observed_pushes(data: Dataset, most: int = 0) -> list[ObservedPushes]:
    """Return the pushes of a recording, their episodes counted from 0.

    With `most`, those of the first whole episodes that hold at most so many pushes.
    """
    episodes, counts = np.unique(data.episode, return_counts=True)
    keep = int(np.searchsorted(np.cumsum(counts), most or len(data), side="right"))
    found = []
    for part in data.parts:
        number = np.searchsorted(episodes, part.episode)
        found.append(replace(part.alone, episode=number).select(number < keep))
    return [part for part in found if len(part)]


def identify(model: SainDynamics, recordings: Recordings) -> Belief:
    """Return what the recordings of one laboratory, by name, add to the belief of a model.

    Raises `DatasetError`: two recordings disagree about the kind of physics or a friction.
    """
    flat = all(part.bodies.lie_flat for parts in recordings.values() for part in parts)
    kinds = laboratory_kinds(model.belief, flat)
    return identified(model, fit_recordings(kinds, recordings), recordings)


def identify_bodies(data: Dataset, most: int = ENOUGH, surface: str = "") -> Belief:
    """Return what up to so many pushes of named bodies on surfaces show, for pushes on a surface.

    Another body may be unlike them: the textbook's belief stays possible. The card has the values
    of each of them.

    Raises `DatasetError`: a body has two outlines.
    """
    textbook = replace(surface_kind(), corrected=True)
    recorded = pushes_of_bodies(data, most)
    population = Population.of(textbook, recorded)
    surface = surface or next_surface(population)
    pushes = sum(len(part) for some in recorded.values() for part in some)
    bodies = {
        str(pair): {name: float(value[0]) for name, value in textbook.values(place[None]).items()}
        for pair, (place, _, _) in population.shown.items()
    }
    kinds = another(population, surface), replace(textbook, name=NO_AXES, log_odds=UNLIKE)
    odd = {
        pair: np.concatenate([_outliers(population, pair, part) for part in some])
        for pair, some in recorded.items()
    }
    wrong = [(pair, unexplained(int(rows.sum()), len(rows))) for pair, rows in odd.items()]
    wrong += [(pair, mirrored(textbook, some[0])) for pair, some in recorded.items()]
    known = known_bodies(population, data, surface)
    found = [f"{pair}: {text}" for pair, text in wrong if text]
    found += [*_unknown(surface, population), *_confused(known)]
    card = {"pushes": pushes, "episodes": len(bodies), "bodies": bodies, "notices": found}
    return Belief(kinds, card=card, bodies=known)


SAME_SIZE: Final = 1.05  # largest radius over the smallest of one body, as it is measured


def _unknown(surface: str, population: Population) -> Iterator[str]:
    """Yield in words that nothing was pushed on a surface that is named."""
    recorded = {pair.surface for pair in population.shown}
    if surface not in (*recorded, ANOTHER):
        names = ", ".join(sorted(recorded))
        yield f"nothing was pushed on surface {surface!r}: it is believed to be like {names}"


def _confused(known: Sequence[KnownBody]) -> Iterator[str]:
    """Yield in words which bodies are not told apart."""
    for shape, count in Counter(one.shape for one in known).items():
        if count > 1:
            names = " and ".join(one.name for one in known if one.shape == shape)
            yield f"{names} have the same outline {shape}: a body is not found by it"
    for one in known:
        least, most = (1e3 * f(one.state[:, RADIUS]) for f in (np.min, np.max))
        if most > SAME_SIZE * least:
            yield f"{one.name}: pushes of radii from {least:.0f} to {most:.0f} mm are taken as one"


def _outliers(population: Population, pair: Pair, pushes: ObservedPushes) -> Mask:
    """Return which pushes (M,) of a body its physics does not explain."""
    values = population.kind.values(np.repeat(population.place(pair)[None], len(pushes), axis=0))
    after = population.kind.step(pushes.bodies, pushes.state, pushes.action, values)
    return are_outliers(after, pushes)


MOVED_ASIDE: Final = 0.02  # [m], between two pushes
FITS: Final = "do frames and outlines fit? An outline may be mirrored"
MOST: Final = 0.5  # of the pushes, which fit no physics
ENOUGH_TO_MIRROR: Final = 5  # pushes
MIRRORED: Final = 0.5  # times the error: with a mirrored outline, less is no chance


def unexplained(odd: int, of: int) -> str:
    """Return in words that pushes fit no physics; empty: all do."""
    more = f"; {FITS}" if odd > MOST * of else ""
    return f"{odd:,} of {of:,} pushes fit no physics and hardly count{more}" if odd else ""


def mirrored(kind: Kind, pushes: ObservedPushes) -> str:
    """Return in words that a lone body moves as if its outline were mirrored; empty: not."""
    shape = pushes.bodies.shapes[0]
    if len(pushes.bodies) > 1 or shape.is_round or len(pushes) < ENOUGH_TO_MIRROR:
        return ""
    corners, errors = shape.outline(float(pushes.state[0, 0, RADIUS])), []
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):
        other = Bodies((trace(shape.name, corners * signs).shape.on(shape.bottom),))
        after = kind.step(other, pushes.state, pushes.action, None)
        off = np.linalg.norm(errors_of(after, pushes.next_state)[:, 0], axis=-1)
        errors.append(float(np.median(off)))
    if min(errors) >= MIRRORED * errors[0]:
        return ""
    return (
        f"its outline may be mirrored: physics errs by {1e3 * errors[0]:.1f} mm, and by"
        f" {1e3 * min(errors):.1f} mm with it mirrored"
    )


def notices(model: SainDynamics) -> list[str]:
    """Return what is wrong with the earlier pushes that a model is conditioned on, in words."""
    if (history := model.history) is None:
        return []
    pushes, first, found = model.observed(history), int(model.now.first[0]), []
    rows = model.now.of_rows(np.zeros(len(pushes), np.int64))
    odd = are_outliers(model.step_rows(pushes.state, pushes.action, rows)[0], pushes)[first:]
    if first:
        found.append(
            f"pushes 1 to {first} of {len(pushes)} do not count: later ones contradict them, as"
            " after a change of the body or the table"
        )
    kind = model.belief.about(model.bodies).likeliest
    found += filter(None, [unexplained(int(odd.sum()), len(odd)), mirrored(kind, pushes)])
    still = (history.state == history.next_state)[..., POSITION].all(axis=(1, 2))
    if still.any():
        found.append(f"{still.sum()} of {len(pushes)} pushes touch nothing and show nothing")
    jump = history.state[1:] - history.next_state[:-1]
    far = np.linalg.norm(jump[..., POSITION], axis=-1).max(axis=-1)
    if (far > MOVED_ASIDE).any():
        number = int(np.argmax(far > MOVED_ASIDE)) + 1
        found.append(
            f"pushes {number} and {number + 1} are out of order, or a body was moved by"
            f" {1e3 * far[number - 1]:.0f} mm between them"
        )
    return found


def _network_odds(model: SainDynamics, found: Episodes, parts: Parts) -> float:
    """Return by how much the network explains the pushes better than the physics alone."""
    odds = KEEP
    for part in parts:
        kind, everywhere = found.kind.of_scene(part.disks), np.ones(len(part), dtype=bool)
        places = found.places[part.episode, : len(kind.names)]
        rows = Posterior.at(Belief((kind,)), 0, places, everywhere)
        both = model.with_bodies(part.bodies).step_rows(part.state, part.action, rows)
        plain, corrected = (
            log_density(errors_of(after, part.next_state), part.scales(FACTORS)).sum(axis=0).max()
            for after in both
        )
        odds += float(corrected - plain)
    return odds


def with_all_parameters(model: SainDynamics) -> SainDynamics:
    """Return a model whose belief is about kinds of physics and all of their parameters.

    Raises `ConfigError`: it infers nothing from pushes.
    """
    kind = model.belief.trained
    if len(model.belief.kinds) > 1:
        return model
    if not kind.names or not isinstance(kind.prior, PlanarPrior) or model.network is None:
        raise ConfigError(f"the model on {model.origin.prior_name!r} infers nothing from pushes")
    return model.believing(default_belief(kind.prior))
