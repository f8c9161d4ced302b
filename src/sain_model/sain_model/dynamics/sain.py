"""SAIN in three parts: physics with its parameters, what is believed of them, and a network.

The physics are the priors of a belief's kinds (`sain_model.inference.kinds`). The belief says,
given an episode's earlier pushes, which kind and which parameters are the most likely. The network
adds what the physics leaves, where no earlier pushes contradict.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.model import Model, Radii, scenes_before
from sain_core.push import LENGTH, pushed_bodies
from sain_core.scene import POSE, POSITION
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import BOTTOMS, Shape
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scalars, Scene, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_store import compile_visibly
from sain_model.compute.threads import even_blocks, run_blocks
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.dynamics.memory import Memory, Recorded
from sain_model.inference.evidence import (
    FACTORS,
    Known,
    ObservedPushes,
    errors_of,
    log_density,
    over_factors,
)
from sain_model.inference.kinds import (
    MASS_RATIO,
    Belief,
    Kind,
    KnownBody,
    corrected_belief,
    only,
    read_belief,
)
from sain_model.inference.posterior import Posterior, infer
from sain_model.network.feature_kernels import LANES
from sain_model.network.features import elongations, network_beliefs, outline_table, push_frames
from sain_model.network.network_kernels import PackedWeights, correct_block
from sain_model.network.settings import EARLIER, IDENTITY, WORLD_FRAME
from sain_model.network.weights import NetworkWeights
from sain_model.physics.parameters import Values, with_mass_ratio
from sain_model.physics.planar import PlanarPrior, step_knowing


class PhysicsPrediction(NamedTuple):
    """What physics predicts for B pushes: what a network corrects."""

    scenes: Scenes  # before the pushes (B, N, 8), with masses as the physics takes them to be
    pushes: Pushes  # (B, A)
    after: Scenes  # (B, N, 8), what physics predicts
    bodies: Bodies = PAPER_DISKS  # of the scenes
    # what is believed of the physics, by name; nothing for a network that does not see it
    values: Values = {}  # noqa: RUF012 - nobody changes it


@dataclass(frozen=True, eq=False)
class ResidualNetwork:
    """f_theta of the paper's equation 2, and regions about its predictions.

    Kernels compute it on all of Numba's threads. They agree with PyTorch's forward pass, which is
    trained, to single precision, and with themselves to the bit: on any number of threads, and for
    a push alone or in any batch.
    """

    weights: NetworkWeights  # the trained weights
    intervals: Intervals | None = None  # the regions of predictions; None: they were not fitted
    # of the bodies that it learned from; for others physics predicts
    bottoms: tuple[str, ...] = BOTTOMS

    @cached_property
    def _packed(self) -> PackedWeights:
        compile_visibly()
        return self.weights.pack()

    @cached_property
    def _each(self) -> list[Self]:
        """Each member of the ensemble alone."""
        members = range(self.weights.config.members)
        return [replace(self, weights=self.weights.member(number)) for number in members]

    def knows(self, bodies: Bodies) -> bool:
        """Return whether it learned from bodies on such bottoms."""
        return all(shape.bottom in self.bottoms for shape in bodies.shapes)

    def correct(self, physics: PhysicsPrediction) -> Scenes:
        """Return what physics predicts (B, N, 8), corrected.

        A push of zero length moves nothing, nor does a body with the role "fixed". Velocities,
        masses and radii are passed on as they are.
        """
        corrected = self._corrected(physics)
        if fixed := list(physics.bodies.fixed):
            corrected[:, fixed] = physics.after[:, fixed]
        return corrected

    def _corrected(self, physics: PhysicsPrediction) -> Scenes:
        corrected = np.array(physics.after, dtype=np.float64, order="C")
        work, size = self.correction(physics._replace(after=corrected)), LANES
        run_blocks(lambda first: work(first, first + size), len(corrected), size)
        return corrected

    def correction(self, physics: PhysicsPrediction) -> Callable[[int, int], None]:
        """Return what corrects predictions in place, up to `LANES` of them.

        It takes the number of the first one, and of the one behind the last one. What physics
        predicts for these is not looked at before.
        """
        scenes, pushes, after, bodies, values = physics
        frames, config = push_frames(scenes, pushes, bodies), self.weights.config
        rows = plain(scenes), plain(frames), after
        believed = plain(network_beliefs(config, values, scenes.shape[1]))
        table = outline_table(bodies.fitted(scenes.shape[1]))
        places, packed = config.features == WORLD_FRAME, self._packed

        def work(first: int, last: int) -> None:
            correct_block(first, last, *rows, believed, table, places, packed)

        return work

    def spread(self, physics: PhysicsPrediction) -> Float[ndarray, "B N"]:
        """Return the standard deviation of the members' places [m]; 0 for a lone network."""
        if self.weights.config.members == 1:
            return np.zeros(physics.scenes.shape[:2])
        places = np.stack([network._corrected(physics)[..., POSITION] for network in self._each])
        spread = np.sqrt(places.var(axis=0, ddof=1).sum(axis=-1))
        return np.where(physics.pushes[:, LENGTH, None] == 0.0, 0.0, spread)

    def with_regions(
        self, prediction: Prediction, scenes: Scenes, pushes: Pushes, bodies: Bodies
    ) -> Prediction:
        """Return a prediction with the regions of bodies; without, where none were fitted."""
        if self.intervals is None:
            return prediction
        long = elongations(bodies.fitted(scenes.shape[1]))
        return self.intervals.about(prediction, scenes, pushed_bodies(pushes), long)


# --- the model ------------------------------------------------------------------------------------

PHYSICS: Final = "physics"  # Fig. 1a: no network
LEARNED: Final = "learned"  # Fig. 1b: the network alone, on the identity prior
RESIDUAL: Final = "residual"  # Fig. 1c, equation 2
RECURRENT: Final = "recurrent"  # Fig. 1d, equations 3 and 4: trained on its own rollouts


@dataclass(frozen=True)
class Origin:
    """Where a model comes from."""

    kind: str = PHYSICS  # `PHYSICS`, `LEARNED`, `RESIDUAL` or `RECURRENT`
    prior_name: str = ""  # of the physics that was corrected, for `sain_core.model.load_dynamics`
    model_hash: str = ""  # SHA-256 of the weights; empty when they come from no checkpoint
    card: str = ""  # the checkpoint's JSON card; empty likewise


@dataclass(frozen=True, eq=False)
class SainDynamics(Model):
    """s' = f_p(s, a) + f_theta(f_p(s, a), s, a), the paper's equation 2."""

    belief: Belief  # kinds of physics, and what is believed of their parameters before an episode
    network: ResidualNetwork | None = None  # what it adds; None: nothing
    origin: Origin = Origin()  # where it comes from
    bodies: Bodies = PAPER_DISKS  # that are pushed
    # the earlier pushes of the episode that it is conditioned on
    history: PushHistory | None = None
    inferred: Posterior | None = None  # what these say, one row; None: there are none

    @property
    def infers(self) -> bool:
        """Whether it infers anything from earlier pushes."""
        return bool(self.belief.likeliest.names)

    @property
    def takes_belief(self) -> bool:
        """Whether `with_belief` applies."""
        return self.network is not None and self.infers

    @cached_property
    def now(self) -> Posterior:
        """What is believed now, one row."""
        return self.inferred or self._inferred_from(PushHistory.empty(len(self.bodies)))

    def _inferred_from(self, history: PushHistory) -> Posterior:
        return self.infer(self.observed(history), Known.first(len(history), [len(history)]))

    @cached_property
    def physics(self) -> Model:
        """f_p: the physics with the parameters that are the most likely now."""
        ((_, kind),) = self.now.by_kind
        return kind.at(self.now.places[0, : len(kind.names)]).with_bodies(self.bodies)

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
        return float(self.now.values(name)[0])

    def spread(self, name: str) -> float:
        """Return the standard deviation of a parameter now: of its logarithm, if it is a factor."""
        return float(self.now.log_spread(name)[0])

    def condition(self, history: PushHistory) -> Self:
        """Return this model conditioned on an episode's earlier pushes.

        They show the kind of physics and those of its parameters that the belief names, and
        whether the network's correction holds.
        """
        if len(history) == 0 or not self.infers:
            return self
        return replace(self, history=history, inferred=self._inferred_from(history))

    def _changed(self, **changes: Any) -> Self:
        """Return this model with changes, conditioned anew."""
        changed = replace(self, **changes, history=None, inferred=None)
        return changed if self.history is None else changed.condition(self.history)

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model of scenes of these bodies.

        Raises `ConfigError`: its physics cannot predict them.
        """
        if bodies == self.bodies:
            return self
        for kind in self.belief.kinds:
            kind.prior.with_bodies(bodies)
        return self._changed(bodies=bodies)

    def physics_alone(self) -> Self:
        """Return its physics, with the same inference and without network and history.

        This is what it is compared with.
        """
        return type(self)(self.belief, bodies=self.bodies)

    def with_unknown_masses(self) -> Self:
        """Return this model where masses are not measured: earlier pushes show their ratio."""
        return self._changed(belief=self.belief.with_unknown_masses())

    def with_belief(self, path: Path) -> Self:
        """Return this model with the belief in a file of ``sain_model identify``.

        Raises `CheckpointError`: no such file, or not a belief; `ConfigError`: it infers nothing
        from pushes, or the belief is for another prior.
        """
        if not self.takes_belief:
            raise ConfigError(
                f"model {self.origin.prior_name!r} takes no belief; 'sain' does, and checkpoints on"
                " planar priors"
            )
        return self.believing(read_belief(path.expanduser()))

    def believing(self, belief: Belief) -> Self:
        """Return this model with another belief.

        Raises `ConfigError`: it is for a network on another prior.
        """
        if belief.trained.has_axes != self.belief.trained.has_axes:
            remedy = "identify with this model"
            if belief.trained.of_bodies:
                remedy = "it is of named bodies: train a model of them (train --belief)"
            raise ConfigError(
                f"the belief is for a network on another prior than {self.origin.prior_name!r};"
                f" {remedy}"
            )
        return self._changed(belief=belief)

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, A) from scenes (B, N, 8).

        `values` (B,) are of parameters that are given, by name; all others are the most likely.
        """
        prior = self.physics
        if isinstance(prior, PlanarPrior) and self.network is not None and self.corrects:
            return self._step_at_once(prior, self.network, scenes, pushes, values)
        physics_next = step_knowing(prior, scenes, pushes, values)
        return self.correct(scenes, pushes, physics_next, values)

    def _step_at_once(
        self,
        prior: PlanarPrior,
        network: ResidualNetwork,
        scenes: Scenes,
        pushes: Pushes,
        values: Values | None,
    ) -> Scenes:
        """Predict by physics and network, each thread its block by both: none waits between."""
        simulation = prior.simulation(scenes, pushes, values)
        after, size = simulation.scenes, even_blocks(len(scenes), LANES)
        correction = network.correction(self._seen_with(scenes, pushes, after, values))

        def work(first: int) -> None:
            simulation.run(first, first + size)
            correction(first, first + size)

        run_blocks(work, len(scenes), size)
        if fixed := list(self.bodies.fixed):
            after[:, fixed, POSE] = scenes[:, fixed, POSE]
        memory = self.now.memories[0]
        return memory.correct(scenes, pushes, after, self.bodies) if memory else after

    def _seen_with(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes, values: Values | None
    ) -> PhysicsPrediction:
        """Return a prediction of physics as the network sees it now, with values that are given."""
        ratio, believed = self._seen_now
        weighed, believed = with_mass_ratio(scenes, ratio), believed | dict(values or {})
        return PhysicsPrediction(weighed, pushes, physics_next, self.bodies, believed)

    def correct(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes, values: Values | None = None
    ) -> Scenes:
        """Return a prediction `physics_next` (B, N, 8) of physics, corrected where that counts."""
        after = physics_next.copy()
        if self.network is not None and self.corrects:
            physics = self._seen_with(scenes, pushes, physics_next, values)
            after = self.network.correct(physics)
        memory = self.now.memories[0]
        return memory.correct(scenes, pushes, after, self.bodies) if memory else after

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radii (K, H, N) [m] of the regions that should hold each body.

        None without fitted regions: see `sain_core.model.Model`.
        """
        if self.network is None or self.network.intervals is None:
            return None
        before = scenes_before(scene, predicted).reshape(-1, *scene.shape)
        radius = self.predict(before, pushes.reshape(-1, pushes.shape[-1])).radius
        assert radius is not None
        return radius.reshape(predicted.shape[:3])

    def predict(self, scenes: Scenes, pushes: Pushes) -> Prediction:
        """Predict as `step` does, and say how certain that is: two to six times the work."""
        prediction = self.predict_rows(
            scenes, pushes, self.now.of_rows(np.zeros(len(pushes), np.int64))
        )
        if prediction.radius is None:
            return prediction
        return prediction.widened(np.repeat(self.widening[:, None], len(pushes), axis=1))

    @cached_property
    def widening(self) -> Float[ndarray, "2"]:
        """The factors of its regions, of places and headings, from the errors of earlier pushes.

        No plan waits for this: only regions need it.
        """
        intervals = self.network and self.network.intervals
        if not intervals or not intervals.adapts:
            return np.ones(2)
        past, predicted = self.predict_past()
        total = intervals.curves(predicted, past).sum(axis=0, keepdims=True)
        return intervals.widening(total, np.array([len(past)]))[:, 0]

    def predict_past(self) -> tuple[PushHistory, Prediction]:
        """Return the earlier pushes, each predicted from those before it; not widened."""
        past = self.history or PushHistory.empty(len(self.bodies))
        count, number = _earlier(len(past))
        rows = self.infer(self.observed(past), Known.first(len(past), count))
        return past, self.predict_rows(past.state, past.action, rows.of_rows(number))

    def observed(self, history: PushHistory) -> ObservedPushes:
        """Return the pushes of one episode for inference."""
        arrays = history.state, history.action, history.next_state
        return ObservedPushes(*arrays, np.zeros(len(history), np.int64), self.bodies, history.noise)

    def infer(self, pushes: ObservedPushes, known: Known) -> Posterior:
        """Return what rows say, each of the pushes that it is conditioned on."""
        pushes = pushes.alone
        belief = self.belief.about(pushes.bodies)
        posterior = infer(belief, pushes, known)
        trained, of_bodies = (
            np.array([getattr(kind, name) for kind in belief.kinds])[posterior.kind]
            for name in ("corrected", "of_bodies")
        )
        knows = self.network is not None and self.network.knows(pushes.bodies)
        always = all(kind.corrected for kind in belief.kinds)
        corrected = trained & knows & (of_bodies | ~posterior.inferred | always)
        posterior = replace(posterior, corrected=corrected)
        if self.network is None:
            return posterior
        return self._judged(pushes, known.after(posterior.first), posterior)

    def _judged(self, pushes: ObservedPushes, known: Known, posterior: Posterior) -> Posterior:
        """Return whether the correction of each row holds, and what errors are left with it."""
        judges, recorded = self.belief.network_log_odds < np.inf, self._recorded(pushes.bodies)
        counts, corrected = known.counts, posterior.corrected.copy()
        shows = (counts > 1) | ((counts > 0) & corrected & judges)
        rows = np.arange(known.rows) if recorded[0] else np.flatnonzero(shows)
        some = known.of_rows(rows)
        each, pairs = rows[some.row], pushes.select(some.push)
        plain, better = self.step_rows(pairs.state, pairs.action, posterior.of_rows(each))
        if judges:
            odds = np.full(known.rows, self.belief.network_log_odds)
            if len(pairs):
                densities = (
                    log_density(errors_of(after, pairs.next_state), pairs.scales(FACTORS))
                    for after in (better, plain)
                )
                more, less = (over_factors(some.gather(density)) for density in densities)
                odds[rows] += more - less
            corrected &= odds > 0.0
        after = np.where(corrected[each, None, None], better, plain)
        memories, ends = posterior.memories.copy(), np.cumsum(some.counts)
        for row, first, end in zip(rows, ends - some.counts, ends, strict=True):
            its, told = slice(first, end), recorded[int(corrected[row])]
            memories[row] = Memory.of(pairs.select(its), after[its], told)
        return replace(posterior, corrected=corrected, memories=memories)

    def _recorded(self, bodies: Bodies) -> list[dict[int, Recorded]]:
        """Return what recordings show of bodies, by their numbers: of physics, and corrected."""
        known = self.belief.known(bodies)
        return [
            {body: recorded_errors(one, bodies.shapes[body], net) for body, one in known.items()}
            for net in (None, self.network)
        ]

    def predict_rows(self, scenes: Scenes, pushes: Pushes, rows: Posterior) -> Prediction:
        """Predict push i with what row i says, and say how certain that is; not widened."""
        physics_next, mean = self.step_rows(scenes, pushes, rows)
        spread = np.zeros(scenes.shape[:2])
        for name in sorted({name for kind in self.belief.kinds for name in kind.on_grid}):
            low, high = (
                self.step_rows(scenes, pushes, rows.moved(name, way))[1] for way in (-1.0, 1.0)
            )
            spread = np.hypot(spread, np.linalg.norm((high - low)[..., POSITION], axis=-1) / 2)
        if self.network is None:
            return Prediction(mean, np.zeros_like(spread), spread)
        physics = self._as_seen(scenes, pushes, physics_next, rows)
        prediction = Prediction(mean, self.network.spread(physics), spread)
        return self.network.with_regions(prediction, scenes, pushes, self.bodies)

    def step_rows(self, scenes: Scenes, pushes: Pushes, rows: Posterior) -> tuple[Scenes, Scenes]:
        """Return what physics predicts for each row, and that with the correction that counts."""
        physics_next = rows.step(self.bodies, scenes, pushes)
        after, chosen = physics_next.copy(), np.flatnonzero(rows.corrected)
        if self.network is not None and len(chosen):
            batch = scenes[chosen], pushes[chosen], physics_next[chosen]
            physics = self._as_seen(*batch, rows.of_rows(chosen))
            after[chosen] = self.network.correct(physics)
        for memory in {id(one): one for one in rows.memories if one}.values():
            mine = np.flatnonzero(rows.memories == memory)
            batch = scenes[mine], pushes[mine], after[mine]
            after[mine] = memory.correct(*batch, self.bodies)
        return physics_next, after

    def _as_seen(
        self, scenes: Scenes, pushes: Pushes, after: Scenes, rows: Posterior
    ) -> PhysicsPrediction:
        """Return what physics predicts for each row as the network sees it."""
        ratio, believed = self._seen(rows)
        weighed = with_mass_ratio(scenes, ratio)
        return PhysicsPrediction(weighed, pushes, after, self.bodies, believed)

    @cached_property
    def _seen_now(self) -> tuple[Scalars, dict[str, Scalars]]:
        return self._seen(self.now)

    def _seen(self, posterior: Posterior) -> tuple[Scalars, dict[str, Scalars]]:
        """Return the ratio of masses, and what the network was made to see of parameters."""
        sees = self.network is not None and self.network.weights.config.believed
        return posterior.values(MASS_RATIO), posterior.believed() if sees else {}


def residual_model(
    weights: NetworkWeights,
    kind: Kind,
    prior_name: str,
    intervals: Intervals | None = None,
    recurrent: bool = False,
    bottoms: Sequence[str] = BOTTOMS,
    history: str = "",
) -> SainDynamics:
    """Return SAIN of a network that was trained on a kind of physics, and on such bodies.

    `history` is what pushes showed of the physics in its training; see `trained_belief`.
    """
    name = RECURRENT if recurrent else RESIDUAL
    origin = Origin(LEARNED if prior_name == IDENTITY else name, prior_name)
    network = ResidualNetwork(weights, intervals, bottoms=tuple(bottoms))
    return SainDynamics(trained_belief(kind, history), network, origin)


def trained_belief(kind: Kind, history: str) -> Belief:
    """Return what is believed where a network is trained: of one kind of physics, or of all.

    With `EARLIER`, earlier pushes show all parameters of a planar prior, as in use.
    """
    if history == EARLIER and isinstance(kind.prior, PlanarPrior):
        return corrected_belief(kind.prior)
    return only(kind)


def with_intervals(model: SainDynamics, intervals: Intervals) -> SainDynamics:
    """Return a model with regions about its predictions."""
    assert model.network is not None
    return replace(model, network=replace(model.network, intervals=intervals))


@lru_cache(64)
def recorded_errors(
    known: KnownBody, shape: Shape, network: ResidualNetwork | None = None
) -> Recorded:
    """Return what recorded pushes of a body show of the errors of its physics, or of SAIN."""
    pushes = ObservedPushes(*known.arrays, np.zeros(len(known.surface), np.int64), Bodies((shape,)))
    after = known.kind.step(pushes.bodies, pushes.state, pushes.action, known.values)
    if network is not None:
        values = known.values if network.weights.config.believed else {}
        seen = PhysicsPrediction(pushes.state, pushes.action, after, pushes.bodies, values)
        after = network.correct(seen)
    return Recorded.of(pushes, after, known.surface, known.log_odds)


def weights_of(model: SainDynamics) -> NetworkWeights:
    """Return the weights of a model's network."""
    assert model.network is not None
    return model.network.weights


def _earlier(pushes: int) -> tuple[Int[ndarray, "C"], Int[ndarray, "P"]]:
    """Return counts of earlier pushes to infer from, and which of them each push is predicted by.

    In long histories several successive pushes share one: their counts grow by a tenth.
    """
    counts = [0]
    while counts[-1] + max(1, counts[-1] // 10) < pushes:
        counts.append(counts[-1] + max(1, counts[-1] // 10))
    return np.array(counts), np.searchsorted(counts, np.arange(pushes), side="right") - 1
