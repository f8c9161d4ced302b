"""The recurrent kind of the paper's Fig. 1d, as equations 3 and 4 have it to the letter.

A network that was trained on rollouts and whose prior goes on from the corrected scene needs no
class of its own: it is a `SainDynamics`, rolled out step by step. Here the prior goes on from its
own scene, which a rollout has to carry along.
"""

import numpy as np

from sain_core.push import LENGTH
from sain_core.types import PredictedScenes, PushSequences, Scalars, Scene, Scenes
from sain_model.dynamics.sain import SainDynamics
from sain_model.physics.planar import step_knowing


class PhysicsChain(SainDynamics):
    """s-bar_{t+1} = f_p(s-bar_t, a_t) and s-hat_{t+1} = f_theta(s-bar_{t+1}, s-hat_t, a_t).

    A single step is that of any `SainDynamics`: at first both scenes are the one that was seen.
    """

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 3) from one scene (N, 8)."""
        return self.roll_out(np.repeat(scene[None], len(pushes), axis=0), pushes)

    def roll_out(
        self, scenes: Scenes, pushes: PushSequences, friction: Scalars | None = None
    ) -> PredictedScenes:
        """Predict scenes (B, H, N, 8) for push sequences (B, H, 3), each from its own scene."""
        predicted = np.empty((*pushes.shape[:2], *scenes.shape[1:]))
        physics, current = scenes, scenes.copy()
        for step in range(pushes.shape[1]):
            push = pushes[:, step]
            physics = step_knowing(self.prior, physics, push, friction)
            moving = push[:, LENGTH] > 0.0
            if moving.any():
                current[moving] = self.correct(current[moving], push[moving], physics[moving])
            predicted[:, step] = current
        return predicted
