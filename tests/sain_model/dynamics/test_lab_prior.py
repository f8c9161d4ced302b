"""The prior of a laboratory: what is off there is kept on a card."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import CheckpointError, ConfigError
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import THETA, make_scene, rotate_scenes
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.lab_prior import LabPrior
from sain_model.dynamics.priors import load_prior, prior_settings
from sain_model.dynamics.settings import PLANAR_LAB
from sain_model.physics.planar import PlanarConfig, PlanarPrior

T = Bodies.named(["t"])
CENTRE = (0.08, -0.05)


def pushes_of(count: int, seed: int = 0) -> tuple[Scenes, Pushes]:
    random = np.random.default_rng(seed)
    scenes = np.stack(
        [
            make_scene(
                np.array([(0.45, 0.0)]), np.array([8.0]), np.array([0.1]), random.uniform(-3, 3, 1)
            )
            for _ in range(count)
        ]
    )
    return scenes, PushLimits().sample(random, count)


def test_a_centre_in_the_middle_is_the_planar_prior() -> None:
    scenes, pushes = pushes_of(30)
    np.testing.assert_allclose(
        LabPrior(bodies=T).step(scenes, pushes),
        PlanarPrior(bodies=T).step(scenes, pushes),
        atol=1e-9,
    )


def test_turned_scenes_are_predicted_turned() -> None:
    prior = LabPrior(bodies=T, centre=CENTRE)
    scenes, pushes = pushes_of(30)
    turned = prior.step(rotate_scenes(scenes, 0.4), pushes)
    np.testing.assert_allclose(turned, rotate_scenes(prior.step(scenes, pushes), 0.4), atol=1e-5)


def test_a_push_of_no_length_moves_nothing() -> None:
    scenes, pushes = pushes_of(3)
    pushes[:, LENGTH] = 0.0
    told = LabPrior(bodies=T, centre=CENTRE).step(scenes, pushes)
    np.testing.assert_array_equal(told, scenes)


def test_a_disk_pushed_through_its_centre_of_mass_goes_straight() -> None:
    places = np.array([(0.4, 0.0), (0.8, 0.0)])
    scene = make_scene(places, np.full(2, 8.0), np.full(2, 0.07), np.zeros(2))[None]
    prior = LabPrior(centre=(0.2, 0.0))
    across = prior.step(scene, np.array([[np.pi / 2, 0.0, 0.1]]))
    along = prior.step(scene, np.array([[0.0, 0.0, 0.1]]))  # on the line through both centres
    assert abs(across[0, 0, THETA]) > 0.1
    assert along[0, 0, THETA] == pytest.approx(0.0, abs=1e-6)


def test_a_card_keeps_what_was_found() -> None:
    prior = LabPrior(replace(PlanarConfig(), friction=0.16), centre=CENTRE)
    assert load_prior(PLANAR_LAB, prior_settings(prior)) == prior
    with pytest.raises(CheckpointError, match="settings of the laboratory's prior"):
        load_prior(PLANAR_LAB, {"friction": 0.1})


def test_its_disks_cannot_be_corrected() -> None:
    scenes = np.repeat(
        make_scene(np.array([(0.4, 0.0), (0.8, 0.0)]), np.full(2, 8.0), np.full(2, 0.07))[None],
        2,
        axis=0,
    )
    with pytest.raises(ConfigError, match="prior of a laboratory cannot be corrected"):
        LabPrior(centre=CENTRE).step_conditioned(
            scenes, np.full((2, 3), 0.05), np.zeros((2, 2, 10))
        )
