"""SAIN as a `Model`: a prior and the network that corrects it."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Final, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError, InvalidInputError
from sain_core.history import PushHistory
from sain_core.model import Model, Radii, scenes_before
from sain_core.push import LENGTH, pushed_bodies
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scalars, Scene, Scenes
from sain_model.compute.batch_checks import check_physics_next
from sain_model.compute.devices import CPU
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.intervals import Intervals, Prediction, pushed_errors
from sain_model.dynamics.learning import (
    Learned,
    after_noisy_pushes,
    after_pushes,
    before_pushes,
    predict_past,
)
from sain_model.dynamics.settings import IDENTITY
from sain_model.dynamics.spreads import physics_spread
from sain_model.identification.belief_file import read_belief
from sain_model.identification.beliefs import Belief
from sain_model.identification.masses import MassFilter
from sain_model.network.compiled_network import CompiledNetwork
from sain_model.network.features import elongations, network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.torch_network import TorchNetwork
from sain_model.physics.friction import FrictionConfig, FrictionFilter
from sain_model.physics.parameters import Values, known_friction
from sain_model.physics.planar import PlanarPrior, step_knowing
from sain_model.physics.planar_config import with_mass_ratio

LEARNED: Final = "learned"  # Fig. 1b: the network alone, on the identity prior
RESIDUAL: Final = "residual"  # Fig. 1c, equation 2
RECURRENT: Final = "recurrent"  # Fig. 1d, equations 3 and 4: trained on its own rollouts


@dataclass(frozen=True, eq=False)
class SainDynamics(Model):
    """s' = f_p(s, a) + f_theta(f_p(s, a), s, a), the paper's equation 2.

    Attributes:
        prior: f_p.
        prior_name: its name for `sain_core.model.load_dynamics`.
        model_hash: SHA-256 of the weights; empty when they come from no checkpoint.
        card: the checkpoint's JSON card; empty likewise.
        friction: how it infers friction from an episode's earlier pushes; None: it was not
            trained to.
        intervals: the regions of its predictions; None: they were not fitted.
        conditioned_log_std: standard deviation of the logarithm of the friction that its prior is
            conditioned on; None: it is not conditioned.
        recurrent: whether it was trained on rollouts of its own predictions.
        device: what the network runs on, ``cpu`` or ``cuda``. The prior stays on the CPU.
        bodies: that are pushed.
        learned: what `condition` was given; None: nothing.
        belief: kinds of physics and parameters that pushes choose from; None: friction alone.
        corrects: whether the network's correction counts.
        mass_log_std: standard deviation of the logarithm of the ratio of masses that its prior is
            conditioned on; 0: masses are measured.
    """

    network: InteractionNetwork
    prior: Model
    prior_name: str
    model_hash: str = ""
    card: str = ""
    friction: FrictionConfig | None = None
    intervals: Intervals | None = None
    conditioned_log_std: float | None = None
    recurrent: bool = False
    device: str = CPU
    bodies: Bodies = PAPER_DISKS
    learned: Learned | None = None
    belief: Belief | None = None
    corrects: bool = True
    mass_log_std: float = 0.0
    takes_belief: ClassVar[bool] = True

    def __post_init__(self) -> None:
        """Stop whatever a network does in training alone."""
        self.network.eval()

    @cached_property
    def _forward(self) -> CompiledNetwork | TorchNetwork:
        """The network as it runs here; its weights are read at the first prediction."""
        if self.device == CPU:
            return CompiledNetwork(self.network)
        return TorchNetwork(self.network, self.device)

    def on(self, device: str) -> Self:
        """Return this model with its network on a device, ``cpu`` or ``cuda``."""
        return replace(self, device=device)

    @property
    def kind(self) -> str:
        """`LEARNED` when the prior is the identity, else `RESIDUAL` or `RECURRENT`."""
        if self.prior_name == IDENTITY:
            return LEARNED
        return RECURRENT if self.recurrent else RESIDUAL

    @property
    def friction_log_std(self) -> float:
        """Standard deviation of the logarithm of the friction; at first, how wide it is drawn."""
        if self.conditioned_log_std is not None:
            return self.conditioned_log_std
        usual = self.filter
        return usual.start().spread if usual else 0.0

    @property
    def filter(self) -> FrictionFilter | None:
        """What infers the friction that the prior is told; None: this model learns nothing."""
        if self.friction is None or not isinstance(self.prior, PlanarPrior):
            return None
        return self.prior.filter(self.friction)

    @property
    def trials(self) -> int:
        """How many predictions it makes of each earlier push that it is told, at least 1."""
        friction = self.filter
        if friction is None:
            return 1
        return MassFilter(friction, self.belief.mass_log_std if self.belief else 0.0).size

    def condition(self, history: PushHistory) -> Self:
        """Return this model on the physics that an episode's earlier pushes tell of.

        With a belief, that is the kind of physics, its parameters, and whether the network's
        correction counts; else the friction with the table. It is the model itself without
        pushes, and where it was not trained to learn from them. From noisy observations it is
        friction alone, with the ratio of masses where these are not measured: the errors of more
        parameters would be those of the observation.
        """
        friction = self.filter
        if friction is None or len(history) == 0:
            return self
        if self.belief is not None and history.noise is None:
            return self._with_same_weights(replace(self, **after_pushes(self, history)))
        if self.belief is not None and self.belief.mass_log_std > 0.0:
            return self._with_same_weights(replace(self, **after_noisy_pushes(self, history)))
        likelihood = friction.likelihoods(history)
        belief = friction.believe(likelihood)
        told = replace(
            self.at(belief.mean, belief.spread), learned=Learned(self, history, likelihood)
        )
        return self._with_same_weights(told)

    @cached_property
    def widening(self) -> float:
        """The factor of its regions, from the errors of earlier pushes.

        Each is predicted from those before it. No plan waits for this: only regions need it.
        """
        told, intervals = self.learned, self.intervals
        if told is None or intervals is None or not intervals.adapts:
            return 1.0
        total = intervals.excess(*pushed_errors(predict_past(told), told.history)).sum()
        return float(intervals.widening(np.array([total]), np.array([len(told.history)]))[0])

    def at(self, friction: float, friction_log_std: float = 0.0) -> Self:
        """Return this model conditioned on a friction and the standard deviation of its log.

        Raises:
            InvalidInputError: the prior knows no friction.
        """
        if not isinstance(self.prior, PlanarPrior):
            raise InvalidInputError(f"the prior {self.prior_name!r} knows no friction")
        return self._with_same_weights(
            replace(self, prior=self.prior.at(friction), conditioned_log_std=friction_log_std)
        )

    def with_prior_belief(self, belief: Belief) -> Self:
        """Return this model with what is believed before an episode's first push.

        Raises:
            ConfigError: it infers nothing from pushes, or the belief is for another prior.
        """
        if self.filter is None:
            raise ConfigError(
                f"the model on {self.prior_name!r} infers nothing from pushes, and takes no belief"
            )
        return self._with_same_weights(replace(self, **before_pushes(self, belief)))

    def with_unknown_masses(self) -> Self:
        """Return this model where masses are not measured: earlier pushes tell their ratio.

        It is the model itself without a belief: then it infers friction alone.
        """
        if self.belief is None:
            return self
        return self.with_prior_belief(self.belief.with_unknown_masses())

    def with_belief(self, path: Path) -> Self:
        """Return this model with the belief in a file of ``sain_model identify``.

        Raises:
            CheckpointError: no such file, or not a belief.
            ConfigError: see `with_prior_belief`.
        """
        return self.with_prior_belief(read_belief(path.expanduser()))

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model of scenes of these bodies.

        Raises:
            ConfigError: its prior cannot predict them.
        """
        if bodies == self.bodies:
            return self
        prior = self.prior.with_bodies(bodies)
        return self._with_same_weights(replace(self, prior=prior, bodies=bodies))

    def _with_same_weights(self, other: Self) -> Self:
        """Return another model with the network of this one, which is not packed again."""
        vars(other)["_forward"] = self._forward
        return other

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 5) from scenes (B, N, 8).

        Args:
            scenes: settled scenes.
            pushes: one a scene.
            values: of parameters of the prior, where it has any (`physics.parameters`).
        """
        return self.correct(scenes, pushes, step_knowing(self.prior, scenes, pushes, values))

    def predict(
        self,
        scenes: Scenes,
        pushes: Pushes,
        friction: Scalars | None = None,
        friction_log_std: Scalars | None = None,
        mass_log_std: Scalars | None = None,
    ) -> Prediction:
        """Predict as `step` does, and say how sure that is; it costs two to six times as much.

        Args:
            scenes: settled scenes.
            pushes: one a scene.
            friction: with the table (B,); None: what this model believes.
            friction_log_std: standard deviation of its logarithm (B,); None: what this model
                believes, or 0 where the friction is given.
            mass_log_std: likewise of the ratio of masses (B,); None: what this model believes.
        """
        if friction_log_std is None:
            usual = self.friction_log_std if friction is None else 0.0
            friction_log_std = np.full(len(pushes), usual)
        if mass_log_std is None:
            mass_log_std = np.full(len(pushes), self.mass_log_std)
        values = known_friction(friction)
        physics_next = step_knowing(self.prior, scenes, pushes, values)
        prediction = Prediction(
            self.correct(scenes, pushes, physics_next),
            self.members_spread(scenes, pushes, physics_next),
            physics_spread(
                self.step, self.prior, scenes, pushes, friction, friction_log_std, mass_log_std
            ),
        )
        told = self.with_regions(prediction, scenes, pushes)
        if told.radius is None or self.widening == 1.0:
            return told
        return replace(told, radius=self.widening * told.radius)

    def with_regions(self, prediction: Prediction, scenes: Scenes, pushes: Pushes) -> Prediction:
        """Return a prediction with the regions of bodies, not widened; without where none are."""
        if self.intervals is None:
            return prediction
        long = elongations(self.bodies.fitted(scenes.shape[1]))
        radii = self.intervals.radii(prediction, scenes, pushed_bodies(pushes), long)
        return replace(prediction, radius=radii)

    def correct(self, scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Scenes:
        """Return the prediction `physics_next` (B, N, 8) of a prior, corrected if that counts.

        Raises:
            InvalidInputError: arrays that do not fit together.
        """
        if self.corrects:
            return self.network_correct(scenes, pushes, physics_next)
        check_physics_next(scenes, physics_next)
        return physics_next.copy()

    def network_correct(self, scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Scenes:
        """Return the prediction `physics_next` (B, N, 8) of a prior, corrected by the network.

        A push of zero length stays what the prior makes of it: nothing. So do bodies with the role
        "fixed". Velocities, masses and radii are passed on as the prior left them.

        Raises:
            InvalidInputError: arrays that do not fit together.
        """
        check_physics_next(scenes, physics_next)
        weighed = self._weighed(scenes)
        corrected = self._forward.correct(weighed, pushes, physics_next, self.bodies)
        if self.bodies.fixed:
            fixed = list(self.bodies.fixed)
            corrected[:, fixed] = physics_next[:, fixed]
        return corrected

    def _weighed(self, scenes: Scenes) -> Scenes:
        """Return scenes with masses as the prior takes them to be."""
        ratio = self.prior.config.mass_ratio if isinstance(self.prior, PlanarPrior) else 1.0
        return with_mass_ratio(scenes, ratio)

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radii (K, H, N) [m] of the regions that should hold each disk.

        None without calibrated regions: see `sain_core.model.RolloutModel`.
        """
        if self.intervals is None:
            return None
        before = scenes_before(scene, predicted).reshape(-1, *scene.shape)
        radius = self.predict(before, pushes.reshape(-1, pushes.shape[-1])).radius
        assert radius is not None
        return radius.reshape(predicted.shape[:3])

    def members_spread(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes
    ) -> Float[ndarray, "B N"]:
        """Return the standard deviation of the members' places [m]; 0 for a lone network."""
        if self.network.config.members == 1:
            return np.zeros(scenes.shape[:2])
        settle_threads()
        config = self.network.config
        frames = push_frames(scenes, pushes, self.bodies)
        weighed = self._weighed(scenes)
        features = network_inputs(config, weighed, frames, physics_next, self.bodies)
        with torch.inference_mode():
            each = self.network.to(self.device).each(*features.tensors(self.device))[..., :2]
        variance = each.double().var(dim=0).sum(dim=-1)  # (B, N), in any frame
        return np.where(pushes[:, LENGTH, None] == 0.0, 0.0, variance.sqrt().cpu().numpy())
