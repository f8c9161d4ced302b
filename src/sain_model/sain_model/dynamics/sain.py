"""SAIN in three parts: physics with its parameters, what is believed of them, and a network.

The physics are the priors of a belief's kinds (`sain_model.inference.kinds`). The belief says,
given an episode's earlier pushes, which kind and which parameters are the most likely. The network
(`sain_model.dynamics.residual`) adds what the physics leaves, where no earlier pushes contradict.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.model import Model, Radii, scenes_before
from sain_core.push import PUSH_SIZE
from sain_core.scene import POSITION
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import BOTTOMS
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.inference.evidence import (
    FACTORS,
    Known,
    ObservedPushes,
    errors_of,
    log_density,
    over_factors,
)
from sain_model.inference.kinds import MASS_RATIO, Belief, by_friction, only, read_belief
from sain_model.inference.posterior import Posterior, believed_values, infer, step_rows
from sain_model.network.settings import CPU
from sain_model.network.weights import NetworkWeights
from sain_model.physics.parameters import Values, check_physics_next, with_mass_ratio
from sain_model.physics.planar import step_knowing

PHYSICS: Final = "physics"  # Fig. 1a: no network
LEARNED: Final = "learned"  # Fig. 1b: the network alone, on the identity prior
RESIDUAL: Final = "residual"  # Fig. 1c, equation 2
RECURRENT: Final = "recurrent"  # Fig. 1d, equations 3 and 4: trained on its own rollouts


@dataclass(frozen=True)
class Origin:
    """Where a model comes from.

    Attributes:
        kind: `PHYSICS`, `LEARNED`, `RESIDUAL` or `RECURRENT`.
        prior_name: of the physics that was corrected, for `sain_core.model.load_dynamics`.
        model_hash: SHA-256 of the weights; empty when they come from no checkpoint.
        card: the checkpoint's JSON card; empty likewise.
    """

    kind: str = PHYSICS
    prior_name: str = ""
    model_hash: str = ""
    card: str = ""


@dataclass(frozen=True, eq=False)
class PhysicsPrediction:
    """What physics predicts for B pushes: what a network corrects.

    Attributes:
        scenes: before the pushes (B, N, 8), with masses as the physics takes them to be.
        pushes: (B, A).
        after: (B, N, 8), what physics predicts.
        bodies: of the scenes.
        values: what is believed of the physics, by name; nothing for a network that does not see
            it.
    """

    scenes: Scenes
    pushes: Pushes
    after: Scenes
    bodies: Bodies
    values: Values


class Network(ABC):
    """What a model adds to what the physics leaves, and regions about its predictions.

    Attributes:
        weights: the trained weights.
        intervals: the regions; None: they were not fitted.
        device: what it runs on, ``cpu`` or ``cuda``. The physics stays on the CPU.
        bottoms: of the bodies that it learned from; for others physics predicts.
    """

    weights: NetworkWeights
    intervals: Intervals | None = None
    device: str = CPU
    bottoms: tuple[str, ...] = BOTTOMS

    def knows(self, bodies: Bodies) -> bool:
        """Return whether it learned from bodies on such bottoms."""
        return all(shape.bottom in self.bottoms for shape in bodies.shapes)

    @property
    def members(self) -> int:
        """The number of networks in the ensemble, whose mean counts."""
        return self.weights.config.members

    @abstractmethod
    def correct(self, physics: PhysicsPrediction) -> Scenes:
        """Return what physics predicts (B, N, 8), corrected.

        A push of zero length moves nothing, nor does a body with the role "fixed". Velocities,
        masses and radii are passed on as they are.

        Raises:
            InvalidInputError: arrays that do not fit together.
        """

    def spread(self, physics: PhysicsPrediction) -> Float[ndarray, "B N"]:
        """Return the standard deviation of the members' places [m]; 0 where none is known."""
        return np.zeros(physics.scenes.shape[:2])

    def with_regions(
        self, prediction: Prediction, scenes: Scenes, pushes: Pushes, bodies: Bodies
    ) -> Prediction:
        """Return a prediction with the regions of bodies; without, where none were fitted."""
        return prediction

    def on(self, device: str) -> Self:
        """Return the network on a device."""
        return self


@dataclass(frozen=True, eq=False)
class Inferred:
    """What each of R rows of pushes says about the physics, and whether the network corrects it."""

    posterior: Posterior
    corrected: Bool[ndarray, "R"]

    def repeated(self, count: int) -> "Inferred":
        """Return the only row so many times."""
        rows = np.zeros(count, np.int64)
        return Inferred(self.posterior.of_rows(rows), self.corrected[rows])


@dataclass(frozen=True, eq=False)
class SainDynamics(Model):
    """s' = f_p(s, a) + f_theta(f_p(s, a), s, a), the paper's equation 2.

    Attributes:
        belief: kinds of physics, and what is believed of their parameters before an episode.
        network: what it adds; None: nothing.
        origin: where it comes from.
        bodies: that are pushed.
        history: the earlier pushes of the episode that it is conditioned on.
    """

    belief: Belief
    network: Network | None = None
    origin: Origin = Origin()
    bodies: Bodies = PAPER_DISKS
    history: PushHistory | None = None

    @property
    def _name(self) -> str:
        return f"model {self.origin.prior_name!r}"

    @property
    def takes_belief(self) -> bool:
        """Whether `with_belief` applies."""
        return self.network is not None and bool(self.belief.likeliest.names)

    @cached_property
    def now(self) -> Inferred:
        """What is believed now, one row."""
        history = self.history
        if history is None or len(history) == 0:
            scenes, none = np.empty((0, len(self.bodies), 8)), np.empty((0, PUSH_SIZE))
            nothing = scenes, none, scenes
            pushes = ObservedPushes(*nothing, np.empty(0, np.int64), self.bodies)
        else:
            pushes = self.observed(history)
        return self.infer(pushes, Known.everything(len(pushes)))

    @cached_property
    def physics(self) -> Model:
        """f_p: the physics with the parameters that are the most likely now."""
        posterior = self.now.posterior
        kind = self.belief.kinds[posterior.kind[0]]
        return kind.at(posterior.places[0, : len(kind.names)]).with_bodies(self.bodies)

    @property
    def corrects(self) -> bool:
        """Whether the network's correction counts now."""
        return bool(self.now.corrected[0])

    @property
    def trials(self) -> int:
        """How many predictions it makes of each earlier push that is new to it, at least 1."""
        return max(len(kind.grid) for kind in self.belief.kinds)

    def value(self, name: str) -> float:
        """Return the value of a parameter that is the most likely now."""
        return float(self.now.posterior.values(self.belief, name)[0])

    def spread(self, name: str) -> float:
        """Return the standard deviation of a parameter now: of its logarithm, if it is a factor."""
        return float(self.now.posterior.log_spread(self.belief, name)[0])

    def condition(self, history: PushHistory) -> Self:
        """Return this model conditioned on an episode's earlier pushes.

        They show the kind of physics and those of its parameters that the belief names, and
        whether the network's correction holds.
        """
        if len(history) == 0 or not self.belief.likeliest.names:
            return self
        conditioned = replace(self, history=history)
        conditioned.physics  # noqa: B018 - inferred here, and not at the first prediction
        return conditioned

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model of scenes of these bodies.

        Raises:
            ConfigError: its physics cannot predict them.
        """
        if bodies == self.bodies:
            return self
        for kind in self.belief.kinds:
            kind.prior.with_bodies(bodies)
        return replace(self, bodies=bodies)

    def on(self, device: str) -> Self:
        """Return this model with its network on a device, ``cpu`` or ``cuda``."""
        return replace(self, network=self.network and self.network.on(device))

    def physics_alone(self) -> Self:
        """Return its physics without network and history; friction alone is inferred, if any is.

        This is what it is compared with. What is inferred of a body on a surface stays.
        """
        kind = self.belief.trained
        belief = only(kind) if kind.of_bodies else by_friction(self.belief)
        return replace(self, belief=belief, network=None, origin=Origin(), history=None)

    def with_unknown_masses(self) -> Self:
        """Return this model where masses are not measured: earlier pushes show their ratio."""
        return replace(self, belief=self.belief.with_unknown_masses())

    def with_belief(self, path: Path) -> Self:
        """Return this model with the belief in a file of ``sain_model identify``.

        Raises:
            CheckpointError: no such file, or not a belief.
            ConfigError: it infers nothing from pushes, or the belief is for another prior.
        """
        if not self.takes_belief:
            return super().with_belief(path)
        return self.believing(read_belief(path.expanduser()))

    def believing(self, belief: Belief) -> Self:
        """Return this model with another belief.

        Raises:
            ConfigError: it is for a network on another prior.
        """
        if belief.trained.has_axes != self.belief.trained.has_axes:
            raise ConfigError(
                f"the belief is for a network on another prior than {self.origin.prior_name!r};"
                " identify with this model"
            )
        return replace(self, belief=belief)

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, A) from scenes (B, N, 8).

        `values` (B,) are of parameters that are given, by name; all others are the most likely.
        """
        physics_next = step_knowing(self.physics, scenes, pushes, values)
        return self.correct(scenes, pushes, physics_next, values)

    def correct(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes, values: Values | None = None
    ) -> Scenes:
        """Return a prediction `physics_next` (B, N, 8) of physics, corrected where that counts."""
        if self.network is None or not self.corrects:
            check_physics_next(scenes, physics_next)
            return physics_next.copy()
        weighed = with_mass_ratio(scenes, self.value(MASS_RATIO))

        believed = {**self._seen(self.now.posterior), **(values or {})}
        physics = PhysicsPrediction(weighed, pushes, physics_next, self.bodies, believed)
        return self.network.correct(physics)

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radii (K, H, N) [m] of the regions that should hold each body.

        None without fitted regions: see `sain_core.model.RolloutModel`.
        """
        if self.network is None or self.network.intervals is None:
            return None
        before = scenes_before(scene, predicted).reshape(-1, *scene.shape)
        radius = self.predict(before, pushes.reshape(-1, pushes.shape[-1])).radius
        assert radius is not None
        return radius.reshape(predicted.shape[:3])

    def predict(self, scenes: Scenes, pushes: Pushes) -> Prediction:
        """Predict as `step` does, and say how certain that is: two to six times the work."""
        prediction = self.predict_rows(scenes, pushes, self.now.repeated(len(pushes)))
        if prediction.radius is None or (self.widening == 1.0).all():
            return prediction
        return prediction.widened(np.repeat(self.widening[:, None], len(pushes), axis=1))

    @cached_property
    def widening(self) -> Float[ndarray, "2"]:
        """The factors of its regions, of places and headings, from the errors of earlier pushes.

        Each is predicted from those before it. No plan waits for this: only regions need it.
        """
        past, intervals = self.history, self.network and self.network.intervals
        if past is None or not intervals or not intervals.adapts:
            return np.ones(2)
        count, number = _earlier(len(past))
        rows = self.infer(self.observed(past), Known.first(len(past), count))
        each = Inferred(rows.posterior.of_rows(number), rows.corrected[number])
        predicted = self.predict_rows(past.state, past.action, each)
        total = intervals.excess(predicted, past).sum(axis=1, keepdims=True)
        return intervals.widening(total, np.array([len(past)]))[:, 0]

    def observed(self, history: PushHistory) -> ObservedPushes:
        """Return the pushes of one episode for inference."""
        arrays = history.state, history.action, history.next_state
        return ObservedPushes(*arrays, np.zeros(len(history), np.int64), self.bodies, history.noise)

    def infer(self, pushes: ObservedPushes, known: Known) -> Inferred:
        """Return what rows say, each of the pushes that it is conditioned on."""
        posterior = infer(self.belief, pushes, known)
        trained = np.array([kind.corrected for kind in self.belief.kinds])
        of_bodies = np.array([kind.of_bodies for kind in self.belief.kinds])
        knows = self.network is not None and self.network.knows(pushes.bodies)
        corrected = trained[posterior.kind] & knows
        corrected &= of_bodies[posterior.kind] | ~posterior.inferred
        if self.belief.network_log_odds == np.inf:
            return Inferred(posterior, corrected)
        rows = np.flatnonzero(corrected)
        odds = self._correction_odds(pushes, known.of_rows(rows), posterior.of_rows(rows))
        corrected[rows] = self.belief.network_log_odds + odds > 0.0
        return Inferred(posterior, corrected)

    def predict_rows(self, scenes: Scenes, pushes: Pushes, rows: Inferred) -> Prediction:
        """Predict push i with what row i says, and say how certain that is; not widened."""
        physics_next, mean = self.step_rows(scenes, pushes, rows)
        spread = np.zeros(scenes.shape[:2])
        for name in sorted({name for kind in self.belief.kinds for name in kind.on_grid}):
            ends = [
                self.step_rows(
                    scenes,
                    pushes,
                    replace(rows, posterior=rows.posterior.moved(self.belief, name, way)),
                )[1]
                for way in (-1.0, 1.0)
            ]
            half = np.linalg.norm((ends[1] - ends[0])[..., POSITION], axis=-1) / 2
            spread = np.hypot(spread, half)
        if self.network is None:
            return Prediction(mean, np.zeros_like(spread), spread)
        weighed = self._weighed(scenes, rows.posterior)
        believed = self._seen(rows.posterior)
        physics = PhysicsPrediction(weighed, pushes, physics_next, self.bodies, believed)
        members = self.network.spread(physics)
        prediction = Prediction(mean, members, spread)
        return self.network.with_regions(prediction, scenes, pushes, self.bodies)

    def step_rows(self, scenes: Scenes, pushes: Pushes, rows: Inferred) -> tuple[Scenes, Scenes]:
        """Return what physics predicts for each row, and that with the correction that counts."""
        physics_next = step_rows(self.belief, self.bodies, scenes, pushes, rows.posterior)
        after, chosen = physics_next.copy(), rows.corrected
        if self.network is not None and chosen.any():
            weighed = self._weighed(scenes, rows.posterior)[chosen]
            posterior = rows.posterior.of_rows(np.flatnonzero(chosen))
            physics = PhysicsPrediction(
                weighed, pushes[chosen], physics_next[chosen], self.bodies, self._seen(posterior)
            )
            after[chosen] = self.network.correct(physics)
        return physics_next, after

    def _correction_odds(
        self, pushes: ObservedPushes, known: Known, posterior: Posterior
    ) -> Float[ndarray, "R"]:
        """Return by how much the network explains the pushes of each row better, as a logarithm."""
        if not known.counts.any() or self.network is None:
            return np.zeros(known.rows)
        pairs, each = pushes.select(known.push), posterior.of_rows(known.row)
        everywhere = Inferred(each, np.ones(len(pairs), dtype=bool))
        with_and_without = self.step_rows(pairs.state, pairs.action, everywhere)
        plain, better = (
            over_factors(
                known.gather(log_density(errors_of(some, pairs.next_state), pairs.scales(FACTORS)))
            )
            for some in with_and_without
        )
        return np.asarray(better - plain)

    def _seen(self, posterior: Posterior) -> Values:
        """Return what the network sees of what rows say of the physics; one row is for all."""
        if self.network is None or not self.network.weights.config.believed:
            return {}
        return believed_values(self.belief, posterior)

    def _weighed(self, scenes: Scenes, posterior: Posterior) -> Scenes:
        """Return scenes (R, N, 8) with masses as the physics takes them to be."""
        return with_mass_ratio(scenes, posterior.values(self.belief, MASS_RATIO))


def _earlier(pushes: int) -> tuple[Int[ndarray, "C"], Int[ndarray, "P"]]:
    """Return counts of earlier pushes to infer from, and which of them each push is predicted by.

    In long histories several successive pushes share one: their counts grow by a tenth.
    """
    counts = [0]
    while counts[-1] + max(1, counts[-1] // 10) < pushes:
        counts.append(counts[-1] + max(1, counts[-1] // 10))
    return np.array(counts), np.searchsorted(counts, np.arange(pushes), side="right") - 1
