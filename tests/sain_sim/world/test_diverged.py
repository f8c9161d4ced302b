"""An engine that leaves the possible ends the push, and the world is as it was before."""

import numpy as np
import pytest

from sain_core.scene import TARGET
from sain_core.world import DivergedError, check_possible


@pytest.mark.parametrize("speed", [60.0, float("nan")])
def test_a_push_that_explodes_has_no_outcome(world, bench, speed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it is
    world.reset(bench.touching())
    before, time = world.observe(), world.time

    def explode(_):
        bench.kick(world, TARGET, (speed, 0.0))

    with pytest.raises(DivergedError, match=r"found no solution of the push: "):
        world.push(bench.straight, on_step=explode)
    assert np.array_equal(world.observe(), before) and world.time == time
    assert world.push(bench.straight).settled


def test_the_body_and_what_is_possible_are_named(bench):
    before = bench.touching()
    check_possible(before, before)
    after = before.copy()
    after[TARGET, 0] += 30.0
    with pytest.raises(
        DivergedError, match=r"body 1 would end 30 m from where .* possible are 2 m"
    ):
        check_possible(before, after)
