"""Rows of our network: SAIN on identified physics, and the network alone, by the one trainer."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.real.folds import first_of_each_body
from benchmarks.real.physics import IdentifiedPhysics, Physics
from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import PARTS, STATED, Predicted, Predictor
from sain_core.model import IdentityPrior
from sain_core.randomness import generator
from sain_core.scene import POSE
from sain_core.transitions import PushHistory, draw_parts
from sain_core.types import Indices
from sain_model.data.dataset import Split
from sain_model.dynamics.identify import ANOTHER, body_names, known_bodies
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.dynamics.sain import SainDynamics, with_intervals
from sain_model.evaluation.errors import predict_known
from sain_model.inference.evidence import Known
from sain_model.inference.kinds import friction_kind, only
from sain_model.inference.population import Pair, Population
from sain_model.network.settings import IDENTITY, PLANAR, PUSH_FRAME
from sain_model.training.fit import fit
from sain_model.training.interval_fit import fit_regions, with_regions
from sain_model.training.kernel_fit import FEW, FOLDS, folds
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
        new: of the training for bodies that are not among those that it learns from.
    """

    folder: Path
    on: IdentifiedPhysics | None = None
    config: TrainingConfig = OF_BODIES
    new: TrainingConfig = OF_NEW

    @property
    def key(self) -> str:
        return "learned" if self.on is None else "sain"

    @property
    def title(self) -> str:
        return "learned only" if self.on is None else "SAIN"

    @property
    def identity(self) -> str:
        return f"{self.config} {self.new} {self.on and self.on.identity}"

    @property
    def learns_anew(self) -> bool:
        return self.on is None

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Train.

        Without physics, own pushes are learned from like all others. With it they identify the
        physics of their bodies, and what the network adds was learned from others.
        """
        if self.on is None:
            return self.of_known(train.and_also(own), self.identified(own))
        physics = self.on.fit(train, own)
        assert isinstance(physics, Physics)
        return OfKnownAndNew(self, train, own, physics)

    def identified(self, pushes: PushTable) -> Physics:
        """Return the physics that pushes show, or none."""
        if self.on is None:
            return Physics(Population.before(friction_kind(IdentityPrior(), infers=False)))
        physics = self.on.fit(pushes, pushes.select(np.zeros(0, np.int64)))
        assert isinstance(physics, Physics)
        return physics

    def of_known(self, pushes: PushTable, physics: Physics) -> "OfKnown":
        """Return a network that was trained on pushes, for the same bodies.

        A fold of them chooses the best epoch. Regions are fitted to folds that neither a network
        nor its physics were fitted to: to each in turn, or of many pushes to one.
        """
        config, few = self.config, len(pushes) <= FEW
        fold = 1 + folds(pushes.group, config.seed) % (FOLDS - 1)
        fold[draw_parts(pushes.group, config.seed, config.validation, 0.0)[1]] = 0
        held = [fold == number for number in range(FOLDS)]
        model = self.trained(pushes.select(~held[0]), pushes.select(held[0]), physics, config)
        crossed = []
        for rows in held if few else held[:1]:
            parts = pushes.select(~rows), pushes.select(rows)
            of_others = self.identified(parts[0])
            another = self.trained(*parts, of_others, config) if few else model
            crossed.append((another, of_others, parts[1]))
        return OfKnown(model, physics, crossed)

    def of_new(self, pushes: PushTable, physics: Physics) -> SainDynamics:
        """Return a network for bodies that are not among these.

        If no epoch is better than the physics on some objects that it did not learn from, the
        physics stays as it is.
        """
        labels = np.unique(pushes.object, return_inverse=True)[1]
        learned, held = draw_parts(labels, self.new.seed, NEW_SHARE, 0.0)[:2]
        return self.trained(pushes.select(learned), pushes.select(held), physics, self.new)

    def trained(
        self, learned: PushTable, held: PushTable, physics: Physics, config: TrainingConfig
    ) -> SainDynamics:
        """Return a network on a physics; a training is kept."""
        config = replace(config, prior=IDENTITY if self.on is None else PLANAR)
        split = Split(learned.dataset, held.dataset, held.dataset.select(np.zeros(len(held), bool)))
        digest = hashlib.sha256(learned.row.tobytes() + str(config).encode())
        if self.on:
            digest.update(physics.identity_of(learned.and_also(held)))
        folder = self.folder / self.key / digest.hexdigest()[:16]
        bodies = physics.population if self.on else None
        kind = replace(physics.population.kind, corrected=True)
        return fit(split, kind, config, folder, bodies=bodies)[0]


@dataclass(frozen=True, eq=False)
class OfKnown:
    """A trained model of bodies that it learned from.

    Attributes:
        model: the physics and the network.
        physics: what is believed of each body.
        crossed: the same, fitted without some pushes, and these, for regions.
    """

    model: SainDynamics
    physics: Physics
    crossed: Sequence[tuple[SainDynamics, Physics, PushTable]]

    def predict(self, pushes: PushTable) -> Predicted:
        """Return the members' mean, and regions that follow each body's errors."""
        parts = [part for *_, held in self.crossed for part in held.dataset.parts]
        predictions = [
            predict_known(model, part, physics.population)
            for model, physics, held in self.crossed
            for part in held.dataset.parts
        ]
        each = np.concatenate([body_names(part) for part in parts])
        names, body = np.unique(each, return_inverse=True)
        regions = fit_regions(predictions, parts, Known.others(body), STATED)
        about = [with_regions(regions, *pair) for pair in zip(predictions, parts, strict=True)]
        curves = [regions.curves(*pair) for pair in zip(about, parts, strict=True)]
        known = Known.of_episodes(body, len(names) + 1)  # the last one: of other bodies
        factors = regions.widening(known.total(np.concatenate(curves)), known.counts)
        found = []
        for part in pushes.dataset.parts:
            same = body_names(part)[:, None] == names
            row = np.where(same.any(axis=1), same.argmax(axis=1), len(names))
            prediction = predict_known(self.model, part, self.physics.population)
            about_these = with_regions(regions, prediction, part)
            found.append(_stated(about_these.widened(factors[:, row])))
        return joined(found)


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
            trained = self.row.of_known(self.train, self.physics)
            parts.append((np.flatnonzero(known), trained.predict(pushes.select(known))))
        if not known.all():
            model = self.row.of_new(self.train, self.physics)
            model = with_intervals(model, self.regions_of_new(model, pushes.select(~known)))
            learned = self.row.identified(self.train).population
            bodies = {
                name: known_bodies(learned, self.train.dataset, name)
                for name in np.unique(pushes.surface[~known])
            }
            for body in np.unique(pushes.body[~known]):
                rows = np.flatnonzero(pushes.body == body)
                some, own = pushes.select(rows), self.own.select(self.own.body == body)
                pair = Pair(some.object[0], some.surface[0])
                kind = replace(self.physics.population.kind_of(pair, own=False), corrected=True)
                belief = replace(only(kind), bodies=bodies[pair.surface])
                (part,) = some.dataset.parts
                new = conditioned(model.believing(belief).with_bodies(part.bodies), own)
                parts.append((rows, _stated(new.predict(part.state, part.action))))
        return joined([one for _, one in parts], np.concatenate([rows for rows, _ in parts]))

    def regions_of_new(self, model: SainDynamics, pushes: PushTable) -> Intervals:
        """Return regions for bodies that nothing is known of but as many own pushes as here.

        They are fitted to bodies of the training, each predicted like these from so few of its
        pushes: without its object, and on a surface that is unknown if theirs are. The network
        learned from these bodies, and adds nothing here.
        """
        count = int(np.unique(self.own.body, return_counts=True)[1].max()) if len(self.own) else 0
        few, others = _few_and_others(self.train, count)
        population, known = self.physics.population, np.isin(pushes.surface, self.train.surface)
        parts, predictions, bodies, steps = [], [], [], []
        for number, body in enumerate(np.unique(self.train.body)):
            own, rest = (some.select(some.body == body) for some in (few, others))
            (part,) = rest.dataset.parts
            pair = Pair(rest.object[0], rest.surface[0] if known.all() else ANOTHER)
            seen = {one: some for one, some in population.shown.items() if one.body != pair.body}
            kind = replace(replace(population, shown=seen).kind_of(pair), corrected=True)
            physics_alone = replace(only(kind), network_log_odds=-np.inf)
            new = conditioned(model.believing(physics_alone).with_bodies(part.bodies), own)
            parts += [*own.dataset.parts, part]
            predictions += [new.predict_past()[1]] if len(own) else []
            predictions.append(new.predict(part.state, part.action))
            bodies.append(np.full(len(own) + len(rest), number))
            steps.append(np.minimum(np.arange(len(own) + len(rest)), len(own)))
        earlier = Known.earlier(np.concatenate(bodies), np.concatenate(steps))
        return fit_regions(predictions, parts, earlier, STATED)


def conditioned(model: SainDynamics, own: PushTable) -> SainDynamics:
    """Return a model of a body that is conditioned on its own pushes."""
    for past in own.dataset.parts:
        model = model.condition(PushHistory(past.state, past.action, past.next_state))
    return model


def _few_and_others(pushes: PushTable, count: int) -> tuple[PushTable, PushTable]:
    """Return so many pushes of each body, and up to `JUDGED` of it that are no repeats of them."""
    order = np.argsort(generator(0, "few").permutation(pushes.group.max() + 1)[pushes.group])
    few = first_of_each_body(pushes, order, count)
    rest = order[~np.isin(pushes.group[order], pushes.group[few])]
    others = first_of_each_body(pushes, rest, JUDGED)
    return pushes.select(np.sort(few)), pushes.select(np.sort(others))


def _stated(prediction: Prediction) -> Predicted:
    """Return poses with regions."""
    sizes = (getattr(prediction, name)[:, 0] for name in PARTS[1:])
    return Predicted(prediction.mean[:, 0, POSE], *sizes)


def joined(parts: Sequence[Predicted], rows: Indices | None = None) -> Predicted:
    """Return predictions one after the other, or in the order of the pushes' numbers."""
    values = [np.concatenate([getattr(one, name) for one in parts]) for name in PARTS]
    return Predicted(*(some if rows is None else some[np.argsort(rows)] for some in values))
