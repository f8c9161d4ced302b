"""Rows of our network: SAIN on identified physics, and the network alone, by the one trainer."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.real.physics import IdentifiedPhysics, Physics
from benchmarks.real.pushes import PushTable
from benchmarks.real.regions import Regions, Scores, fit_regions
from benchmarks.real.rows import Predicted, Predictor
from sain_core.dataset import draw_parts
from sain_core.model import IdentityPrior
from sain_core.scene import POSE, POSITION
from sain_model.data.bodies import believed_places, with_beliefs
from sain_model.data.dataset import Split
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import Inferred, SainDynamics
from sain_model.dynamics.settings import IDENTITY, PLANAR
from sain_model.inference.kinds import friction_kind
from sain_model.inference.posterior import Posterior
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.training.objectives import SinglePushes
from sain_model.training.settings import NOTHING, LossConfig, TrainingConfig
from sain_model.training.trainer import Trainer

NEW_SHARE: Final = 0.2  # of the objects, that stand for new ones
SETTINGS: Final = TrainingConfig(
    history=NOTHING,
    test=0.0,
    epochs=80,
    loss=LossConfig(heading_scale=0.02),
    network=NetworkConfig(hidden=128, features=WORLD_FRAME, believed=True, members=4),
)
OF_NEW: Final = replace(  # where the table is known, and the body is not
    SETTINGS,
    epochs=20,
    network=replace(SETTINGS.network, features=PUSH_FRAME, believed=False, members=2),
)
ALONE: Final = replace(  # without physics, of which nothing is believed then
    SETTINGS, epochs=40, network=replace(SETTINGS.network, believed=False, members=2)
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
    config: TrainingConfig = SETTINGS
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
            nothing = Physics(friction_kind(IdentityPrior(), infers=False), {})
            return self.trained(train.and_also(own), nothing, known=True)
        physics = self.on.fit(train, own)
        assert isinstance(physics, Physics)
        return OfKnownAndNew(self, train, physics)

    def trained(self, pushes: PushTable, physics: Physics, known: bool) -> "FittedNetwork":
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
        split = Split(
            *(
                with_beliefs(some.dataset, physics.kind, physics.places)
                for some in (learned, held, held)
            )
        )
        network = new_network(config.network, config.seed)
        objective = SinglePushes(split, physics.kind, config)
        seen = {name: z for name, z in physics.places.items() if name in pushes.body}
        digest = hashlib.sha256(pushes.row.tobytes() + replace(physics, places=seen).identity)
        path = self.folder / self.key / f"{digest.hexdigest()[:16]}-{known:d}.pt"
        Trainer(network, objective, config, path, keeps_start=not known).run()
        model = residual_model(network, physics.kind, config.prior)
        return FittedNetwork(model, physics, fit_regions(held, *predicted_by(model, physics, held)))


@dataclass(frozen=True, eq=False)
class OfKnownAndNew:
    """SAIN: one network for bodies that were trained on, and one for others; made when needed."""

    row: NetworkRow
    train: PushTable
    physics: Physics

    def predict(self, pushes: PushTable) -> Predicted:
        """Predict each push by the network for its body."""
        is_known = np.isin(pushes.body, np.unique(self.train.body))
        parts = [
            (np.flatnonzero(chosen), self.row.trained(self.train, self.physics, known))
            for known, chosen in ((True, is_known), (False, ~is_known))
            if chosen.any()
        ]
        found = [fitted.predict(pushes.select(rows)) for rows, fitted in parts]
        order = np.argsort(np.concatenate([rows for rows, _ in parts]))
        return Predicted(
            np.concatenate([one.poses for one in found])[order],
            np.concatenate([one.radius for one in found])[order],
            np.concatenate([one.turn for one in found])[order],
        )


@dataclass(frozen=True, eq=False)
class FittedNetwork:
    """A trained model on a physics, with regions at all levels."""

    model: SainDynamics
    physics: Physics
    regions: Regions

    def predict(self, pushes: PushTable) -> Predicted:
        """Return the members' mean, and regions about it."""
        poses, scores = predicted_by(self.model, self.physics, pushes)
        turn = self.regions.turn(scores, pushes.radius)
        return Predicted(poses, self.regions.radius(scores), turn)


def predicted_by(
    model: SainDynamics, physics: Physics, pushes: PushTable
) -> tuple[Float[ndarray, "M 3"], Scores]:
    """Return poses after pushes with what is believed of each body, and scores for regions."""
    poses, scores = [], []
    for part in pushes.dataset.parts:
        places = believed_places(part, physics.kind, physics.places)
        rows = Inferred(Posterior.at(model.belief, 0, places), np.ones(len(part), dtype=bool))
        found = model.with_bodies(part.bodies).predict_rows(part.state, part.action, rows)
        way = np.linalg.norm((found.mean - part.state)[:, 0, POSITION], axis=1)
        poses.append(found.mean[:, 0, POSE])
        scores.append([found.members[:, 0], found.friction[:, 0], way])
    return np.concatenate(poses), np.concatenate(scores, axis=1)
