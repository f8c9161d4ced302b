"""Rows of our network: SAIN on identified physics, and the network alone, by the one trainer."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.real.folds import first_of_each_body
from benchmarks.real.physics import IdentifiedPhysics, Physics
from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import PARTS, STATED, Predicted, Predictor
from sain_core.model import IdentityPrior
from sain_core.randomness import generator
from sain_core.scene import POSE
from sain_core.transitions import PushHistory, draw_parts
from sain_core.types import Indices
from sain_model.data.dataset import Part, Split
from sain_model.dynamics.identify import body_names, known_bodies, pushes_of_bodies
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.dynamics.sain import SainDynamics, with_intervals
from sain_model.evaluation.errors import predict_known
from sain_model.inference.kinds import KnownBody, friction_kind, only
from sain_model.inference.population import Pair, Population
from sain_model.network.settings import IDENTITY, PLANAR, PUSH_FRAME
from sain_model.training.fit import fit
from sain_model.training.interval_fit import fit_regions, with_regions
from sain_model.training.settings import OF_BODIES, TrainingConfig

NEW_SHARE: Final = 0.2  # of the objects, that stand for new ones
JUDGED: Final = 60  # pushes of each body that regions of new ones are fitted to

OF_NEW: Final = replace(  # where the table is known, and the body is not
    OF_BODIES,
    epochs=20,
    network=replace(OF_BODIES.network, features=PUSH_FRAME, believed=False, members=2),
)
ALONE: Final = replace(  # without physics, of which nothing is believed then
    OF_BODIES, epochs=40, network=replace(OF_BODIES.network, believed=False, members=2)
)


@dataclass(frozen=True)
class NetworkRow:
    """Our network, on a physics that is identified on the same pushes or on none.

    Attributes:
        folder: where trainings are kept.
        on: the physics; None: the network alone.
        config: of the training.
        of_new: of the training for bodies that are not among those that it learns from.
    """

    folder: Path
    on: IdentifiedPhysics | None = None
    config: TrainingConfig = OF_BODIES
    of_new: TrainingConfig = OF_NEW

    @property
    def key(self) -> str:
        return "learned" if self.on is None else "sain"

    @property
    def title(self) -> str:
        return "learned only" if self.on is None else "SAIN"

    @property
    def identity(self) -> str:
        return f"{self.config} {self.of_new} {self.on and self.on.identity}"

    @property
    def learns_anew(self) -> bool:
        return self.on is None

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Train.

        Without physics, own pushes are learned from like all others. With it they identify the
        physics of their bodies, and what the network adds was learned from others.
        """
        if self.on is None:
            nothing = Physics(Population.before(friction_kind(IdentityPrior(), infers=False)))
            return self.trained(train.and_also(own), nothing, known=True)
        physics = self.on.fit(train, own)
        assert isinstance(physics, Physics)
        return OfKnownAndNew(self, train, own, physics)

    def trained(self, pushes: PushTable, physics: Physics, known: bool) -> "OfKnown":
        """Return a network that was trained on pushes, with regions; a training is kept.

        The best epoch is chosen, and regions are fitted, by a share of the groups of repeats: for
        predictions of `known` bodies. For those of new bodies it is a share of the objects, and if
        no epoch is better there than the physics, the physics stays as it is.
        """
        config = self.config if known else self.of_new
        config = replace(config, prior=IDENTITY if self.on is None else PLANAR)
        labels = pushes.group if known else np.unique(pushes.object, return_inverse=True)[1]
        share = config.validation if known else NEW_SHARE
        learned, held = (
            pushes.select(rows) for rows in draw_parts(labels, config.seed, share, 0.0)[:2]
        )
        split = Split(learned.dataset, held.dataset, held.dataset.select(np.zeros(len(held), bool)))
        digest = hashlib.sha256(pushes.row.tobytes())
        if self.on:
            digest.update(physics.identity_of(pushes))
        folder = self.folder / self.key / f"{digest.hexdigest()[:16]}-{known:d}"
        bodies = physics.population if self.on else None
        kind = replace(physics.population.kind, corrected=True)
        model, _ = fit(split, kind, config, folder, bodies=bodies)
        return OfKnown(model, physics, held)


@dataclass(frozen=True, eq=False)
class OfKnown:
    """A trained model of bodies that it learned from.

    Attributes:
        model: the physics and the network.
        physics: what is believed of each body.
        held: pushes of the same bodies that no weight was fitted to, for regions.
    """

    model: SainDynamics
    physics: Physics
    held: PushTable

    def predict(self, pushes: PushTable) -> Predicted:
        """Return the members' mean, and regions that follow each body's errors in `held`."""
        parts = self.held.dataset.parts
        predictions = [self.predicted(part) for part in parts]
        regions = fit_regions(predictions, parts, STATED)
        widening = _of_bodies(regions, predictions, parts)
        found = []
        for part in pushes.dataset.parts:
            factors = np.stack([widening.get(name, np.ones(2)) for name in body_names(part)], 1)
            found.append(_stated(self.predicted(part), part, regions, factors))
        return joined(found)

    def predicted(self, part: Part, corrected: bool = True) -> Prediction:
        """Return what is predicted with what is believed of each body."""
        return predict_known(self.model, part, self.physics.population, corrected)


@dataclass(frozen=True, eq=False)
class OfKnownAndNew:
    """SAIN: one network for bodies that were trained on, and one for others; made when needed.

    A new body is predicted as by a user's model that is conditioned on the body's own pushes.
    """

    row: NetworkRow
    train: PushTable
    own: PushTable
    physics: Physics

    def predict(self, pushes: PushTable) -> Predicted:
        """Predict each push by the network for its body."""
        known = np.isin(pushes.body, np.unique(self.train.body))
        parts = []
        if known.any():
            trained = self.row.trained(self.train, self.physics, known=True)
            parts.append((np.flatnonzero(known), trained.predict(pushes.select(known))))
        if not known.all():
            model = self.row.trained(self.train, self.physics, known=False).model
            regions = self.regions_of_new(model)
            model = with_intervals(model, regions)
            bodies = {name: self.recorded(name) for name in np.unique(pushes.surface[~known])}
            for body in np.unique(pushes.body[~known]):
                rows = np.flatnonzero(pushes.body == body)
                some = pushes.select(rows)
                found = self.of_new(model, regions, some, bodies[some.surface[0]])
                parts.append((rows, found))
        return joined([one for _, one in parts], np.concatenate([rows for rows, _ in parts]))

    def recorded(self, surface: str) -> tuple[KnownBody, ...]:
        """Return the bodies of the training, as a belief for a surface has them."""
        assert self.row.on is not None
        learned = self.row.on.fit(self.train, self.own.select(np.zeros(0, np.int64)))
        assert isinstance(learned, Physics)
        return known_bodies(learned.population, self.train.dataset, surface)

    def of_new(
        self,
        model: SainDynamics,
        regions: Intervals,
        pushes: PushTable,
        bodies: tuple[KnownBody, ...],
    ) -> Predicted:
        """Predict pushes of a body by a model that is conditioned on its own pushes."""
        (part,) = pushes.dataset.parts
        pair = Pair(pushes.object[0], pushes.surface[0])
        kind = replace(self.physics.population.kind_of(pair, own=False), corrected=True)
        belief = replace(only(kind), bodies=bodies)
        conditioned = model.believing(belief).with_bodies(part.bodies)
        own = self.own.select(self.own.body == pushes.body[0])
        for past in own.dataset.parts:
            history = PushHistory(past.state, past.action, past.next_state)
            conditioned = conditioned.condition(history)
        rows = conditioned.now.of_rows(np.zeros(len(part), np.int64))
        prediction = conditioned.predict_rows(part.state, part.action, rows)
        factors = np.repeat(conditioned.widening[:, None], len(part), axis=1)
        return _stated(prediction, part, regions, factors)

    def regions_of_new(self, model: SainDynamics) -> Intervals:
        """Return regions for bodies that nothing is known of but as many own pushes as here.

        They are fitted to bodies of the training, each predicted from so few of its pushes.
        """
        count = int(np.unique(self.own.body, return_counts=True)[1].max()) if len(self.own) else 0
        few, others = _few_and_others(self.train, count)
        population = self.physics.population
        places = {pair: population.belief(pair)[0] for pair in population.shown}
        unseen = {pair: one._replace(place=places[pair]) for pair, one in population.shown.items()}
        new = replace(population, shown=unseen)
        if count:
            new = new.learn(pushes_of_bodies(few.dataset))
        as_new = OfKnown(model, Physics(new), others)
        parts = others.dataset.parts
        return fit_regions([as_new.predicted(part, False) for part in parts], parts, STATED)


def _few_and_others(pushes: PushTable, count: int) -> tuple[PushTable, PushTable]:
    """Return so many pushes of each body, and up to `JUDGED` of it that are no repeats of them."""
    order = np.argsort(generator(0, "few").permutation(pushes.group.max() + 1)[pushes.group])
    few = first_of_each_body(pushes, order, count)
    rest = order[~np.isin(pushes.group[order], pushes.group[few])]
    others = first_of_each_body(pushes, rest, JUDGED)
    return pushes.select(np.sort(few)), pushes.select(np.sort(others))


# --- regions --------------------------------------------------------------------------------------


def _of_bodies(
    intervals: Intervals, predictions: Sequence[Prediction], parts: Sequence[Part]
) -> dict[str, Float[ndarray, "2"]]:
    """Return the factors of regions of each body, from the errors of its pushes.

    They are so large that regions with them hold the stated share of all pushes.
    """
    about = [with_regions(intervals, *pair) for pair in zip(predictions, parts, strict=True)]
    each = [intervals.excess(*pair) for pair in zip(about, parts, strict=True)]
    excess, names = np.concatenate(each, axis=1), np.concatenate([body_names(p) for p in parts])
    bodies, place, counts = np.unique(names, return_inverse=True, return_counts=True)
    totals = np.stack([np.bincount(place, row) for row in excess])
    factors = intervals.widening(totals, counts)
    usual = np.array(intervals.usual_log)
    left = np.quantile(excess - np.log(factors[:, place]), intervals.level, axis=1) + usual
    factors *= np.exp(left)[:, None]
    return dict(zip(bodies.tolist(), factors.T, strict=True))


def _stated(
    prediction: Prediction, part: Part, regions: Intervals, factors: Float[ndarray, "2 M"]
) -> Predicted:
    """Return poses with regions."""
    about = with_regions(regions, prediction, part).widened(factors)
    sizes = (getattr(about, name)[:, 0] for name in PARTS[1:])
    return Predicted(prediction.mean[:, 0, POSE], *sizes)


def joined(parts: Sequence[Predicted], rows: Indices | None = None) -> Predicted:
    """Return predictions one after the other, or in the order of the pushes' numbers."""
    values = [np.concatenate([getattr(one, name) for one in parts]) for name in PARTS]
    return Predicted(*(some if rows is None else some[np.argsort(rows)] for some in values))
