"""Settings of a training by name: ours, and what the paper says in both of its readings.

The paper (section III-C): Adam at 0.001, halved every 2,500 steps, 8,000 epochs of batches of 16,
validated every 500 epochs on 20 % of the data, the best kept; 10 % in section III-B; equation 5
adds lambda |theta|^2. It gives neither lambda nor the scales of the loss: ours stand here.
With 3,000 transitions an epoch is 188 steps, so that the learning rate is halved every 13 of the
8,000 epochs and is nothing long before the first validation: either the steps are epochs, or the
epochs are steps. See docs/training.md.
"""

from dataclasses import replace
from typing import Final

from sain_model.dynamics.settings import LossConfig
from sain_model.training.settings import (
    ADAM,
    HALVING_EPOCHS,
    HALVING_STEPS,
    NOTHING,
    OptimizerConfig,
    TrainingConfig,
)

LAMBDA: Final = 1e-6  # of equation 5, of a loss in units of 1 mm

PAPER: Final = TrainingConfig(
    epochs=8000,
    validate_every=500,
    batch=16,
    learning_rate=1e-3,
    weight_decay=2 * LAMBDA,  # the gradient of lambda |theta|^2
    mirror=False,
    validation=0.2,
    history=NOTHING,
    loss=LossConfig(robust=False, position_scale=0.001, velocity_scale=0.1, heading_scale=0.05),
    optimizer=OptimizerConfig(ADAM, HALVING_STEPS, 2500),
)
PAPER_EPOCHS: Final = replace(PAPER, optimizer=OptimizerConfig(ADAM, HALVING_EPOCHS, 2500))
PAPER_STEPS: Final = replace(PAPER, epochs=16, epoch_steps=500, validate_every=1)
"""8,000 steps, validated every 500 of them."""

PRESETS: Final = {
    "default": TrainingConfig(),
    "paper": PAPER,
    "paper-epochs": PAPER_EPOCHS,
    "paper-steps": PAPER_STEPS,
}
