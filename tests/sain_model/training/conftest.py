"""Small collections in which any body is pushed, of scenes of one to four bodies."""

import pytest

from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig

SCENES = EpisodeConfig(pushes=3, shapes="t,bar,disk", bodies="1-4")


@pytest.fixture(scope="session")
def any_bodies(tmp_path_factory):
    """A collection to learn from."""
    folder = tmp_path_factory.mktemp("any")
    collect(CollectConfig(folder, 24, 3, episode=SCENES))
    return folder


@pytest.fixture
def more_bodies(tmp_path):
    """Another one, to go on with."""
    collect(CollectConfig(tmp_path / "more", 12, 4, episode=SCENES))
    return tmp_path / "more"
