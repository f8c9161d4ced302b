"""Layers of an ensemble: every member has weights of its own, and one call runs them all."""

import functools

import torch
from jaxtyping import Float
from torch import Tensor, nn


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


def make_perceptron(
    inputs: int, outputs: int, hidden: int, layers: int, members: int = 1
) -> nn.Sequential:
    """Return a perceptron with so many hidden layers of this width, for one network or more."""
    linear = nn.Linear if members == 1 else functools.partial(MemberLinear, members)
    modules: list[nn.Module] = []
    for width in [inputs, *[hidden] * (layers - 1)]:
        modules += [linear(width, hidden), nn.SiLU()]
    return nn.Sequential(*modules, linear(hidden, outputs))


def zero_last_layer(perceptron: nn.Sequential) -> None:
    """Let a perceptron start out by saying nothing."""
    for parameter in perceptron[-1].parameters():
        nn.init.zeros_(parameter)
