"""A table that is physics itself: what a laboratory learns there can be compared with the truth."""

from dataclasses import replace

import numpy as np

from sain_core.model import load_dynamics
from sain_core.push import PushLimits
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_lab.storage.results import Result
from sain_model.dynamics.load import parse_card, save_checkpoint, shipped_checkpoint
from sain_model.dynamics.sain import weights_of
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarPrior

DISKS = Bodies.disks(2)
TRUE = replace(
    TEXTBOOK, friction=0.2, tool_friction=0.3, slope_x=0.15, length_offset=-0.004, inertia=0.4
)


class SmallTable:
    """Pushes two disks at random, in episodes."""

    def __init__(self, seed=0, config=TRUE, noise=0.0002, pushes=6):
        self.random, self.world = np.random.default_rng(seed), PlanarPrior(config)
        self.noise, self.each, self.count, self.episode = noise, pushes, 0, 0
        self.scene = self.reset()

    def reset(self):
        scene = np.zeros((2, STATE_SIZE))
        scene[:, :2] = [[0.5, 0.0], self.random.normal([0.7, 0.0], [0.02, 0.05])]
        scene[:, 2] = self.random.uniform(-3, 3, 2)
        scene[:, 6:] = [[8.0, 0.08], [8.0, 0.06]]
        return scene

    def push(self):
        """Return the next result."""
        if self.count % self.each == 0:
            self.scene, self.episode = self.reset(), self.episode + 1
        self.count += 1
        push = PushLimits().sample(self.random, 1)
        before = self.scene
        after = self.world.step(before[None], push)[0]
        after[:, :2] += self.random.normal(0.0, self.noise, (2, 2))
        self.scene = after
        return Result(push[0], before, after, bodies=DISKS, episode=f"small/{self.episode}")


def plant(path):
    """Write the shipped network, which belongs to no table here, made worse."""
    shipped = load_dynamics("sain")
    weights = weights_of(shipped)
    for name in weights.tensors:
        weights.tensors[name] *= 1.5 if name.startswith("dynamics") else 1.0
    path.parent.mkdir(parents=True, exist_ok=True)
    card = parse_card(shipped_checkpoint(), shipped.origin.card)
    # on friction alone, so that earlier pushes do not switch it off
    save_checkpoint(path, weights, replace(card, training={**card.training, "history": "episode"}))
