"""What the image shows is where it is."""

import numpy as np
import pytest

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.feasibility import Feasibility
from sain_core.push import make_push
from sain_core.scene import POSITION
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym.picture import MARGIN, TopPicture
from tests.sain_gym.playing import MakeEnv

SIZE = 240
TABLE = Feasibility().table


def colour(name: str) -> np.ndarray:
    return np.round(255 * np.array(rgba(name)[:3]))


def at(image: np.ndarray, x: float, y: float) -> np.ndarray:
    """The pixel of a point [m]: x points up and y to the left."""
    side = TABLE.y_max - TABLE.y_min + 2 * MARGIN
    middle = (TABLE.x_min + TABLE.x_max) / 2
    row, column = (middle + side / 2 - x) / side, (side / 2 - y) / side
    return image[int(row * SIZE), int(column * SIZE)]


@pytest.mark.parametrize("scenario", ["anywhere", "push_t", "rearrange_3"])
def test_bodies_and_goals_are_where_they_are(make: MakeEnv, scenario: str) -> None:
    env = make(scenario=scenario, observation="image", image_size=SIZE)
    image, _ = env.reset(seed=2)
    first = colour(PALETTE.mid)
    shown = np.argwhere((image == first).all(axis=-1))
    assert len(shown) > 100
    if scenario != "push_t":  # the middle of a T may lie on its edge
        assert at(image, *env.scene[0, POSITION]).tolist() == first.tolist()
    goal = env.episode.record.goal
    body, place = goal.wanted[0], goal.places[0]
    wanted = colour(PALETTE.disk(body))
    assert np.abs(at(image, *place) - wanted).max() < 40
    assert (image == colour(PALETTE.goal)).all(axis=-1).any()


def test_the_reach_is_shown_on_the_table_only() -> None:
    case = SCENARIOS["paper"].scene(0)
    from sain_gym.episode import PushEpisode, Tolerance

    image = TopPicture(SIZE).draw(PushEpisode(case, case.disks, Tolerance(0.02)).record, case.disks)
    assert at(image, 0.4, 0.4).tolist() == colour(PALETTE.reach).tolist()
    assert at(image, 1.1, 0.4).tolist() == colour(PALETTE.table).tolist()
    assert at(image, 1.25, 0.0).tolist() == colour(PALETTE.line).tolist()


def test_a_push_changes_the_image(make: MakeEnv) -> None:
    env = make(scenario="paper", observation="image")
    before, _ = env.reset(seed=0)
    kept = before.copy()
    after, *_ = env.step(make_push(0.0, 0.0, 0.15))
    assert (after != before).any()
    assert np.array_equal(before, kept)
