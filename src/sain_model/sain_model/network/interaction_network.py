"""The interaction network of the paper's section II-C: f_rel over pairs, f_dyn over bodies.

It may also correct parameters of the planar prior. A residual on a prediction would have to learn
how each push responds to what the prior lacks: a slope shifts a disk that coasts for long, and one
that is held not at all. A prior with a corrected slope responds by itself. So the network corrects
ten numbers of each disk:

| column | what | 1 means | at most |
| --- | --- | --- | --- |
| DRAG | friction with the table, logarithm of a factor | 0.3 | 1.2 |
| PULL_X, PULL_Y | acceleration along the world's axes, as on a slope | 0.1 m/s^2 | 0.5 m/s^2 |
| MASS_FORE, MASS_LEFT | from a body's centroid to its centre of mass | 0.1 radii | 0.35 radii |
| RIM_GRIP | friction with bodies nearer to the push, logarithm of a factor | 0.5 | 2.0 |
| TOOL_GRIP | friction with the tool, likewise | 0.5 | 2.0 |
| LENGTH | how much further the tool goes; of the pushed body alone | 5 mm | 20 mm |
| ANGLE | which way it goes, likewise | 0.05 rad | 0.3 rad |
| LOCATION | where around that body it starts, its way kept, likewise | 0.05 rad | 0.3 rad |

All are 0 for the prior as it is. They saturate smoothly, so that all corrections are
physically possible: masses stay within a disk's feet, factors above 0.
"""

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor, nn

from sain_core.push import pushed_bodies
from sain_core.randomness import generator
from sain_core.types import Pushes
from sain_model.network.feature_kernels import GAP_AFTER, GAP_BEFORE, PLACE_FEATURES, TURN_SCALE
from sain_model.network.features import count_features
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import PlanarConfig, check_finite

DRAG, PULL_X, PULL_Y, MASS_FORE, MASS_LEFT, RIM_GRIP, TOOL_GRIP = range(7)
OF_DISKS: Final = 7  # columns of each disk; the others are of the tool
LENGTH, ANGLE, LOCATION = range(7, 10)
CORRECTIONS: Final = 10
UNIT: Final = np.array([0.3, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.005, 0.05, 0.05])
MOST: Final = np.array([1.2, 0.5, 0.5, 0.35, 0.35, 2.0, 2.0, 0.02, 0.3, 0.3])

FACTORS: Final = {"friction_scale": DRAG, "disk_friction": RIM_GRIP, "tool_friction": TOOL_GRIP}
SHIFTS: Final = {
    "slope_x": PULL_X, "slope_y": PULL_Y, "centre_x": MASS_FORE, "centre_y": MASS_LEFT
}  # fmt: skip
OF_TOOL: Final = {"length_offset": LENGTH, "angle_offset": ANGLE, "location_offset": LOCATION}

Corrections = Float[ndarray, "B N C"]  # C = CORRECTIONS


def saturated(corrections: Corrections) -> Corrections:
    """Return corrections in plain units (B, N, 10), none beyond what is possible."""
    return np.asarray(MOST * np.tanh(corrections * (UNIT / MOST)))


def corrected_values(
    corrections: Corrections, pushes: Pushes, config: PlanarConfig
) -> dict[str, ndarray]:
    """Return the parameters of a prior with these settings, as corrected, by name.

    Raises:
        InvalidInputError: corrections that are not finite.
    """
    check_finite("corrections", corrections)
    change = saturated(corrections)
    pushed = change[np.arange(len(pushes)), pushed_bodies(pushes)]
    values = {name: change[..., column] for name, column in SHIFTS.items()}
    for name, column in FACTORS.items():
        values[name] = getattr(config, name) * np.exp(change[..., column])
    return values | {name: pushed[:, column] for name, column in OF_TOOL.items()}


OUTPUTS: Final = 3  # dx, dy, dtheta
CHUNK: Final = 512  # pushes at a time: what all members make of them fits the cache
POSITION_UNIT: Final = 0.005  # [m], an output of 1; dtheta counts in TURN_SCALE
BEFORE: Final = slice(-PLACE_FEATURES, 2 - PLACE_FEATURES)  # a body's place in the world
AFTER: Final = slice(2 - PLACE_FEATURES, 4 - PLACE_FEATURES)
MAP_SCALE: Final = 2.0  # of the map's part in DRAG
MAP_FINENESS: Final = 3.0  # its first layer starts out so much steeper than others


class MemberLinear(nn.Module):
    """A linear layer for each of M members, in one batched product.

    Attributes:
        weight: (M, outputs, inputs); a member's are drawn as those of `torch.nn.Linear` are.
        bias: (M, outputs).
    """

    def __init__(self, members: int, inputs: int, outputs: int) -> None:
        """Draw the weights of every member."""
        super().__init__()
        layers = [nn.Linear(inputs, outputs) for _ in range(members)]
        self.weight = nn.Parameter(torch.stack([layer.weight.detach() for layer in layers]))
        self.bias = nn.Parameter(torch.stack([layer.bias.detach() for layer in layers]))

    def forward(self, inputs: Float[Tensor, "M *B I"]) -> Float[Tensor, "M *B O"]:
        """Apply each member's layer to its own inputs."""
        rows = inputs.flatten(1, -2)  # (M, rows, I)
        outputs = torch.baddbmm(self.bias.unsqueeze(1), rows, self.weight.transpose(1, 2))
        return outputs.unflatten(1, inputs.shape[1:-1])


class InteractionNetwork(nn.Module):
    """Predicts what the prior gets wrong, for each of any number of bodies.

    It may be an ensemble: M networks side by side, whose mean it predicts. It may also correct
    parameters of the prior (`corrections`). Then it has one map of the table for all bodies: what a
    place does to a body is the same for every body that comes by. The map is a function of place
    alone, read along the straight line from where a body stands to where the uncorrected prior
    predicts it. Its mean goes into `DRAG`, and all of it into f_dyn.
    """

    unit: Tensor
    way: Tensor

    def __init__(self, config: NetworkConfig = NetworkConfig()) -> None:
        """Build it so that it starts out by leaving the prior as it is."""
        super().__init__()
        self.config = config
        size = config.hidden, config.layers, config.members
        of_body, of_relation = count_features(config)
        outputs = OUTPUTS + (CORRECTIONS if config.corrects_parameters else 0)
        inputs = of_body + config.message + config.places
        self.relation = _perceptron(of_relation, config.message, *size)
        self.dynamics = _perceptron(inputs, outputs, *size)
        _zero_last_layer(self.dynamics)
        if config.places:
            self.map = _perceptron(2, 1, *size)
            steep = MAP_FINENESS / 2**0.5
            nn.init.uniform_(next(self.map.parameters()), -steep, steep)
            _zero_last_layer(self.map)
            self.register_buffer("way", torch.linspace(0, 1, config.places), persistent=False)
        unit = torch.tensor([POSITION_UNIT, POSITION_UNIT, TURN_SCALE])
        self.register_buffer("unit", unit, persistent=False)

    def forward(
        self, bodies: Float[Tensor, "B N D"], relations: Float[Tensor, "B E R"]
    ) -> Float[Tensor, "B N 3"]:
        """Return the residual of each body: dx, dy [m] in the push frame, dtheta [rad]."""
        if self.config.members == 1:
            return self.each(bodies, relations)[0]
        parts = zip(bodies.split(CHUNK), relations.split(CHUNK), strict=True)
        return torch.cat([self.each(*part).mean(dim=0) for part in parts])

    def each(
        self, bodies: Float[Tensor, "*M B N D"], relations: Float[Tensor, "*M B E R"]
    ) -> Float[Tensor, "M B N 3"]:
        """Return every member's residual, of the same inputs or each of its own (M, ...)."""
        return self.heads(bodies, relations)[0]

    def heads(
        self, bodies: Float[Tensor, "*M B N D"], relations: Float[Tensor, "*M B E R"]
    ) -> tuple[Float[Tensor, "M B N 3"], Float[Tensor, "M B N C"]]:
        """Return as `each` the residual, and what every member corrects; C = 0 where none does.

        With corrections, the residual is that of what the prior predicts with them.
        """
        if bodies.ndim == 3:
            bodies = bodies.expand(self.config.members, *bodies.shape)
            relations = relations.expand(self.config.members, *relations.shape)
        inputs = [bodies, sum_messages(self.relation, relations, bodies.shape[2])]
        if self.config.places:
            inputs.append(self._look_up(bodies))
        output: Tensor = self.dynamics(torch.cat(inputs, dim=-1))
        residual, corrections = output.split([OUTPUTS, output.shape[-1] - OUTPUTS], dim=-1)
        if self.config.places:
            drag = torch.zeros_like(corrections)
            drag[..., DRAG] = MAP_SCALE * inputs[-1].mean(dim=-1)
            corrections = corrections + drag
        return residual * self.unit, corrections

    def _look_up(self, bodies: Float[Tensor, "M B N D"]) -> Float[Tensor, "M B N P"]:
        """Return the map along the way of each body."""
        before, after = bodies[..., None, BEFORE], bodies[..., None, AFTER]
        along: Tensor = self.map(before + self.way[:, None] * (after - before))
        return along.squeeze(-1)


def sum_messages(
    perceptron: nn.Module, relations: Float[Tensor, "*B E R"], bodies: int
) -> Float[Tensor, "*B N F"]:
    """Return the messages to each body, of the others and of the tool, added up.

    Bodies far apart send no messages, so that more of them change nothing either.
    """
    gaps = torch.minimum(relations[..., GAP_BEFORE], relations[..., GAP_AFTER])
    messages: Tensor = perceptron(relations) * (1.0 - gaps).unsqueeze(-1)
    return messages.unflatten(-2, (bodies, -1)).sum(dim=-2)


def new_network(config: NetworkConfig, seed: int) -> InteractionNetwork:
    """Return a network with weights drawn from a seed; each member's by themselves."""
    alone = replace(config, members=1)
    networks = []
    for member in range(config.members):
        path = ("weights",) if member == 0 else ("weights", "member", member)
        torch.manual_seed(int(generator(seed, *path).integers(2**31)))
        networks.append(InteractionNetwork(alone))
    return networks[0] if config.members == 1 else ensemble(networks)


def ensemble(networks: Sequence[InteractionNetwork]) -> InteractionNetwork:
    """Return the ensemble of networks of one size."""
    joined = InteractionNetwork(replace(networks[0].config, members=len(networks)))
    states = [network.state_dict() for network in networks]
    joined.load_state_dict({name: torch.stack([s[name] for s in states]) for name in states[0]})
    return joined


def _perceptron(inputs: int, outputs: int, hidden: int, layers: int, members: int) -> nn.Sequential:
    """Return a perceptron with so many hidden layers of this width, for one network or more."""
    linear = nn.Linear if members == 1 else functools.partial(MemberLinear, members)
    modules: list[nn.Module] = []
    for width in [inputs, *[hidden] * (layers - 1)]:
        modules += [linear(width, hidden), nn.SiLU()]
    return nn.Sequential(*modules, linear(hidden, outputs))


def _zero_last_layer(perceptron: nn.Sequential) -> None:
    """Let a perceptron start out by saying nothing."""
    for parameter in perceptron[-1].parameters():
        nn.init.zeros_(parameter)
