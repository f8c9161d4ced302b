import json
import logging
from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.scene import POSITION
from sain_core.transitions import COLLECTION_FILE, Column
from sain_core.world import DivergedError
from sain_sim.collecting.collect import CARD_FILE, CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeRunner
from sain_sim.collecting.shards import load_shards
from sain_sim.world.engines import MUJOCO
from sain_sim.world.truth import TruthConfig

pytest.importorskip("mujoco", reason="MuJoCo is not installed")

EPISODE = EpisodeConfig(pushes=3, floor_episodes=1, truth=TruthConfig(engine=MUJOCO))


def test_a_collection_says_its_engine_and_repeats(tmp_path):
    config = CollectConfig(out=tmp_path / "one", episodes=2, seed=3, episode=EPISODE)
    collect(config)
    collect(replace(config, out=tmp_path / "two"))
    names = [path.name for path in sorted(config.out.iterdir())]
    for name in names:
        assert (tmp_path / "two" / name).read_bytes() == (config.out / name).read_bytes()
    for file in (COLLECTION_FILE, CARD_FILE):
        assert json.loads((config.out / file).read_text())["truth"]["engine"] == "mujoco"
    data = load_shards(config.out)
    before = data[Column.STATE].reshape(-1, 2, 8)
    after, again = (data[c].reshape(-1, 2, 8) for c in (Column.NEXT_STATE, Column.FLOOR_NEXT))
    assert np.linalg.norm((after - before)[..., POSITION], axis=-1).max() > 0.02
    floor = np.abs(again - after)[data[Column.EPISODE] == 0][..., POSITION]
    assert floor.max() < 2e-3  # the truth's engine repeats them, not Bullet
    bullet = replace(EPISODE, truth=TruthConfig())
    with pytest.raises(DatasetError, match="was collected with truth"):
        collect(replace(config, episode=bullet))


def test_a_push_that_diverges_ends_its_episode_and_is_not_recorded(monkeypatch, caplog):
    runner = EpisodeRunner(3, EPISODE)
    whole = runner.run(1)
    push, calls = runner._world.push, []

    def fail_at_the_second(*arguments):
        if len(calls) == 1:
            raise DivergedError("no solution")
        outcome = push(*arguments)
        calls.append(outcome)
        return outcome

    monkeypatch.setattr(runner._world, "push", fail_at_the_second)
    with caplog.at_level(logging.WARNING):
        cut = runner.run(1)
    assert len(whole.transitions) == 3 and len(cut.transitions) == 1
    assert np.array_equal(cut.transitions[0][Column.NEXT_STATE], whole.transitions[0]["next_state"])
    assert cut.counts.refused == cut.counts.stuck == 1
    assert "an episode ends after 1 pushes: no solution" in caplog.text
    runner.close()
