"""The image shows the scene and the goal of the environment."""

import numpy as np
import pytest

from sain_core.push import make_push
from sain_core.scene import POSITION
from sain_core.view.image import TopPicture
from sain_core.view.palette import PALETTE, rgba

SIZE = 240


@pytest.mark.parametrize("scenario", ["anywhere", "rearrange_3"])
def test_a_push_changes_the_image(make, scenario):
    env = make(scenario=scenario, observation="image", image_size=SIZE)
    image, _ = env.reset(seed=2)
    kept = image.copy()
    at = TopPicture(SIZE).pixel(env.scene[0, POSITION])
    assert image[at].tolist() == np.round(255 * np.array(rgba(PALETTE.mid)[:3])).tolist()
    goal = np.round(255 * np.array(rgba(PALETTE.goal)[:3]))
    assert (image == goal).all(axis=-1).any()
    after, *_ = env.step(make_push(0.0, 0.0, 0.15))
    assert (after != image).any() and np.array_equal(image, kept)
