from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ConfigError, DatasetError
from sain_core.randomness import generator
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig
from sain_sim.collecting.shards import load_shards
from sain_sim.world.engines import BULLET, MUJOCO
from sain_sim.world.roughness import Roughness
from sain_sim.world.truth import LABS, RIM_FRICTION, TABLE_FRICTION, TruthConfig, effects_of

ROUGH = TruthConfig("rough", lab=2)
ENGINE = {"rough": BULLET, "measured": MUJOCO}


def drawn(truth: TruthConfig, episode: int, count: int = 2):
    return truth.draw(generator(7, "episode", episode), count)


def test_a_lab_stays_and_its_disks_differ():
    episodes = [drawn(ROUGH, episode) for episode in range(20)]
    assert len({(p.friction, p.rim_friction, p.roughness) for p in episodes}) == 1
    assert len({(p.masses, p.radii) for p in episodes}) == 20
    low, high = TABLE_FRICTION["rough"]
    assert low <= episodes[0].friction <= high
    assert RIM_FRICTION[0] <= episodes[0].rim_friction <= RIM_FRICTION[1]
    assert drawn(replace(ROUGH, lab=3), 0).roughness != episodes[0].roughness


def test_effects_are_switched_one_by_one():
    for world in LABS:
        lab = TruthConfig(world, effects="none", lab=2, engine=ENGINE[world])
        smooth = drawn(lab, 0)
        assert smooth.roughness == Roughness()
        assert smooth.rim_friction == smooth.tool_friction == 0.12
        for effect in effects_of(world):
            alone = drawn(replace(lab, effects=effect), 0)
            assert alone.friction == smooth.friction
            assert bool(alone.roughness.arrays()) == (effect not in ("rims", "grip"))
            assert (alone.rim_friction != 0.12) == (effect == "rims")
            assert (alone.tool_friction != 0.12) == (effect == "grip")
            assert (alone.bottom == "flat") == (effect == "pressure")
    varied = [drawn(replace(ROUGH, effects="all, friction"), i) for i in range(2)]
    assert varied[0].friction != varied[1].friction
    assert varied[0].roughness == varied[1].roughness == drawn(ROUGH, 0).roughness


@pytest.mark.parametrize("effects", ["wind", "tilt,none", ""])
def test_effects_that_do_not_exist_are_named(effects):
    with pytest.raises(ConfigError, match="effect"):
        TruthConfig("rough", effects).draw(generator(0, "x"))


def test_a_rough_collection_says_what_is_rough_and_repeats(tmp_path):
    config = EpisodeConfig(pushes=3, floor_episodes=1, truth=ROUGH)
    runs = [CollectConfig(tmp_path / name, episodes=2, seed=1, episode=config) for name in "ab"]
    done = collect(runs[0])
    assert done == collect(runs[1]) and done.transitions > 2
    data, again = (load_shards(run.out) for run in runs)
    assert all(np.array_equal(data[k], again[k], equal_nan=True) for k in data)
    rough = drawn(ROUGH, 0).roughness
    assert np.array_equal(data["rough_mass_offsets"][0], rough.mass_offsets)
    assert np.array_equal(data["rough_tilt"][-1], rough.tilt)
    # the floor knows all of it, the nominal shadow none
    repeated = np.isfinite(data["floor_next"]).all(axis=1)
    floor = np.abs(data["floor_next"] - data["next_state"])[repeated].max()
    shadow = np.abs(data["physics_next"] - data["next_state"])[repeated].max()
    assert floor < shadow / 3
    with pytest.raises(DatasetError, match="was collected with truth"):
        collect(replace(runs[0], episode=replace(config, truth=TruthConfig())))
