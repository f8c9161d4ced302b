"""Answers what a model is asked over a wire: checked and bounded. No middleware here."""

import logging
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Final

import numpy as np

from sain_core.errors import ConfigError, InvalidInputError, OutOfRangeError, TooMuchWorkError
from sain_core.model import (
    Model,
    Radii,
    answering,
    as_observed,
    check_rollout,
    check_step,
    load_dynamics,
)
from sain_core.push import check_predictable, make_push, pushed_bodies
from sain_core.scene import MASS, OVERLAP_TOLERANCE, THETA, make_scene, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, check_scenes
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes
from sain_model.dynamics.identify import notices
from sain_model.dynamics.sain import PHYSICS, Origin, SainDynamics
from sain_model.inference.kinds import FRICTION
from sain_model.physics.planar import PlanarPrior

if TYPE_CHECKING:
    from sain_model.serving.service import ServingConfig

logger = logging.getLogger(__name__)

WARM_UP_SCENE: Final = make_scene(
    np.array([(0.4, 0.0), (0.6, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
WARM_UP_PUSHES: Final = make_push([[0.0], [0.5]], [[0.0], [0.1]], [[0.1], [0.05]])  # (2, 1, 5)
# (32, 1, 5), none like another: a model predicts those that are alike once
TRIAL_PUSHES: Final = make_push(np.linspace(0.0, 3.0, 32)[:, None], 0.1, 0.05)
TRIALS: Final = 3  # the fastest counts: other programs may take the processor
SLOWEST: Final = 0.002  # [s] for a prediction: planners wait 2 s for thousands
MOST_NOTICES: Final = 16  # of histories, that are logged once
SEEN_OVERLAP: Final = 0.02  # [m], of bodies with corners: cameras are not exact


class ModelServer:
    """One model, asked for single pushes in a batch or for whole sequences.

    It never serves another one: that gets a server of its own (`with_model`), made on any thread,
    and the node goes on with it in one assignment.
    """

    def __init__(self, dynamics: Model, config: "ServingConfig") -> None:
        self.config = config
        self._label = f"model {config.model!r}"
        self.name, self.origin = config.model, Origin(PHYSICS, config.model)
        if isinstance(dynamics, SainDynamics) and dynamics.network is not None:
            self.origin = dynamics.origin
        self._usual = dynamics
        self._learned: tuple[PushHistory, Bodies, Model] | None = None
        self._noticed: tuple[str, ...] = ()  # the latest, which are not logged again

    def with_model(self, name: str, bodies: Bodies = PAPER_DISKS) -> "ModelServer":
        """Return a server of another model (see `load_server`) in a scene of bodies, for a planner.

        Raises `ConfigError`: it cannot predict these bodies, or too slowly; also as `load_server`.
        """
        other = load_server(replace(self.config, model=name))
        other.knowing(None, bodies)
        other.check_pace()
        return other

    def check_pace(self) -> None:
        """Check that a planner can wait for this model; raises `ConfigError`: it is too slow."""
        times = []
        for _ in range(TRIALS):
            begun = perf_counter()
            self._usual.rollout(WARM_UP_SCENE, TRIAL_PUSHES)
            times.append((perf_counter() - begun) / len(TRIAL_PUSHES))
        if min(times) > SLOWEST:
            raise ConfigError(
                f"{self._label} takes {1e3 * min(times):.0f} ms for a prediction; a planner needs"
                f" thousands of at most {1e3 * SLOWEST:.0f} ms: choose a faster one, such as sain"
            )

    def try_out(self) -> None:
        """Answer requests of both kinds, so that none from outside waits for compilation.

        Raises `ModelUnavailableError`: the model answers with something that no answer can be.
        """
        with answering(self._label):
            self.rollout(WARM_UP_SCENE, WARM_UP_PUSHES)
            self.predict(np.stack([WARM_UP_SCENE] * len(WARM_UP_PUSHES)), WARM_UP_PUSHES[:, 0])

    def knowing(self, history: PushHistory | None, bodies: Bodies = PAPER_DISKS) -> Model:
        """Return the model for these bodies, conditioned on an episode's earlier pushes.

        Raises `TooMuchWorkError`: more pushes than the limit of work allows; `ConfigError`: the
        model cannot predict these bodies.
        """
        if history is None or len(history) == 0:
            return self._usual.with_bodies(bodies)
        trials = self._usual.trials if isinstance(self._usual, SainDynamics) else 1
        self.check_work(len(history) * trials, history.disks)
        kept = self._learned
        if kept is None or not (kept[0] is history or kept[0].equals(history)) or kept[1] != bodies:
            model = self._usual.with_bodies(bodies).condition(history)
            self._learned = history, bodies, model
            for notice in notices(model) if isinstance(model, SainDynamics) else ():
                if notice not in self._noticed:
                    logger.warning("earlier pushes: %s", notice)
                    self._noticed = (*self._noticed[-MOST_NOTICES:], notice)
            return model
        return kept[2]

    def friction(self, history: PushHistory | None, bodies: Bodies = PAPER_DISKS) -> float:
        """Return the friction of a prediction; 0: the model has none."""
        dynamics = self.knowing(history, bodies)
        if not isinstance(dynamics, SainDynamics) or not isinstance(dynamics.physics, PlanarPrior):
            return 0.0
        return dynamics.value(FRICTION)

    def rollout(
        self,
        scene: Scene,
        pushes: PushSequences,
        history: PushHistory | None = None,
        bodies: Bodies = PAPER_DISKS,
    ) -> PredictedScenes:
        """Predict (K, H, N, 8) for push sequences (K, H, 5) from a scene (N, 8) of an episode.

        Raises: as `predict`.
        """
        self.check_work(pushes.shape[0] * pushes.shape[1], len(scene))
        check_asked_scenes(scene[None], bodies)
        check_asked_pushes(pushes, bodies)
        predicted = self.knowing(history, bodies).rollout(scene, pushes)
        return check_rollout(predicted, scene, pushes, self._label)

    def regions(
        self,
        scene: Scene,
        pushes: PushSequences,
        predicted: PredictedScenes,
        history: PushHistory | None = None,
        bodies: Bodies = PAPER_DISKS,
    ) -> Radii | None:
        """Return how sure the model is of a rollout (K, H, N) [m]; None: it cannot tell.

        `predicted` is what `rollout` answered.
        """
        return self.knowing(history, bodies).regions(scene, pushes, predicted)

    def predict(
        self,
        scenes: Scenes,
        pushes: Pushes,
        physics_next: Scenes | None = None,
        history: PushHistory | None = None,
        bodies: Bodies = PAPER_DISKS,
    ) -> tuple[Scenes, Scenes]:
        """Predict where pushes (B, 5) lead from scenes (B, N, 8) of an episode with earlier pushes.

        `physics_next` (B, N, 8) is corrected; None: what the model's own prior predicts. Returned
        are the residual, angles wrapped, and the next state (B, N, 8).

        Raises `InvalidInputError`: a scene that cannot exist; `OutOfRangeError`: a push that no
        arm's limits could allow, or against a body that is not pushable; `ConfigError`: the model
        cannot predict these bodies; `TooMuchWorkError`: B x N is above the limit, or N alone;
        `ModelUnavailableError`: the model answers with something that no answer can be.
        """
        self.check_work(len(scenes), scenes.shape[1])
        check_asked_scenes(scenes, bodies)
        check_asked_pushes(pushes, bodies)
        dynamics = self.knowing(history, bodies)
        if physics_next is None:
            prior = dynamics.physics if isinstance(dynamics, SainDynamics) else dynamics
            physics_next = check_step(prior.step(scenes, pushes), scenes, self._label)
        elif not np.array_equal(physics_next[..., MASS:], scenes[..., MASS:]):
            raise InvalidInputError(
                "physics_next states other masses or radii than the scenes; a push changes neither"
            )
        next_state = physics_next  # physics alone corrects nothing
        if isinstance(dynamics, SainDynamics):
            next_state = dynamics.correct(scenes, pushes, physics_next)
        check_step(next_state, scenes, self._label)
        residual = next_state - physics_next
        residual[..., THETA] = wrap_angle(residual[..., THETA])
        return residual, next_state

    def check_work(self, predictions: int, disks: int) -> None:
        """Raise `TooMuchWorkError` where a request is larger than the settings allow."""
        if disks > self.config.max_disks:
            raise TooMuchWorkError(
                f"scenes of {disks} disks; at most {self.config.max_disks} are accepted"
            )
        work = predictions * disks
        if work > self.config.max_work:
            raise TooMuchWorkError(
                f"{predictions} predictions of {disks} disks are {work} of work;"
                f" at most {self.config.max_work} are accepted"
            )


def load_server(config: "ServingConfig") -> ModelServer:
    """Return a server of the model that the settings name, loaded and tried.

    Raises `CheckpointError`: a checkpoint that is missing, damaged or of another version;
    `ConfigError`: no model of this name; `ModelUnavailableError`: it predicts NaN or Inf.
    """
    model = load_dynamics(config.model)
    if config.belief:
        model = model.with_belief(Path(config.belief))
    server = ModelServer(as_observed(model, config.unknown), config)
    server.try_out()
    return server


def check_asked_scenes(scenes: Scenes, bodies: Bodies) -> None:
    """Raise `InvalidInputError` unless all scenes (B, N, 8) can be of these bodies."""
    check_scenes(scenes, bodies, OVERLAP_TOLERANCE if bodies.all_round else SEEN_OVERLAP)


def check_asked_pushes(pushes: Pushes, bodies: Bodies) -> None:
    """Raise `OutOfRangeError` unless all pushes can be asked about, against pushable bodies."""
    check_predictable(pushes)
    pushed = np.unique(pushed_bodies(pushes))
    wrong = [int(body) for body in pushed if body not in bodies.pushable]
    if wrong:
        role = bodies.roles[wrong[0]] if wrong[0] < len(bodies) else "not there"
        raise OutOfRangeError(
            f"a push is against body {wrong[0]}, which is {role};"
            f" pushable are: {', '.join(map(str, bodies.pushable))}"
        )
