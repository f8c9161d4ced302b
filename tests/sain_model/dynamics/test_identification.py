"""Identification finds the constants of a laboratory that has nothing else."""

from dataclasses import replace

import numpy as np

from benchmarks.identification import identify
from sain_model.data.dataset import load_dataset
from sain_model.network import corrections as told
from sain_model.physics.planar import PlanarPrior


def test_the_constants_of_a_laboratory_are_found(dataset) -> None:
    data, prior = load_dataset(dataset).alike, PlanarPrior()
    truth = np.zeros((2, told.CORRECTIONS))
    truth[:, told.PULL_X], truth[:, told.DRAG] = 1.0, -0.5
    truth[0, told.MASS_LEFT], truth[1, told.RIM_GRIP] = 0.8, 1.5
    everywhere = np.tile(truth, (len(data), 1, 1))
    values = told.corrected_values(everywhere, data.action, prior.config)
    after = prior.step(data.state, data.action, values)
    found = identify(prior, replace(data, next_state=after))
    for column in (told.PULL_X, told.DRAG, told.MASS_LEFT):
        np.testing.assert_allclose(found[0, column], truth[0, column], atol=0.25)
    assert found[1, told.RIM_GRIP] > 0.8
