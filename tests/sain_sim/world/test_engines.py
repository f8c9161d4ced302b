import importlib.util
import subprocess
import sys

import pytest

from sain_core.errors import ConfigError
from sain_sim.world import engines
from sain_sim.world.engines import BULLET, ENGINES, MUJOCO, check_engine
from sain_sim.world.truth import ROUGH, TruthConfig, check_effects, effects_of

MISSING = "engine mujoco needs the package mujoco, which is not installed: pip install mujoco"


@pytest.fixture
def without_mujoco(monkeypatch):
    def find(name):
        return None if name == "mujoco" else importlib.util.find_spec(name)

    monkeypatch.setattr(engines, "find_spec", find)


def test_bullet_is_the_default_and_has_all_effects_of_a_rough_world():
    assert TruthConfig().engine == BULLET == next(iter(ENGINES))
    check_effects(BULLET, effects_of(ROUGH))


def test_an_engine_that_is_not_installed_is_an_error_that_names_the_extra(without_mujoco):
    with pytest.raises(ConfigError) as caught:
        check_engine(MUJOCO)
    assert str(caught.value) == MISSING
    check_engine(BULLET)


def test_an_engine_that_does_not_exist_is_refused():
    with pytest.raises(ConfigError, match="engine 'ode' is unknown; known: bullet, mujoco"):
        check_engine("ode")
    with pytest.raises(ConfigError, match="engine 'ode' is unknown; known: bullet, mujoco"):
        TruthConfig(engine="ode")


WITHOUT_BULLET = """
import sys
sys.modules["pybullet"] = None  # as where it is not installed
import numpy as np
from sain_core.push import make_push
from sain_core.errors import ConfigError
from sain_core.scene import make_scene
from sain_sim.world.truth import TruthConfig
from sain_sim.world.engines import check_engine
from sain_sim.world.shadow import BulletPrior
places = np.array([(0.45, 0.0), (0.7, 0.1)])
scene = make_scene(places, np.array([8.0, 8.0]), np.array([0.08, 0.06]))
print(TruthConfig().engine)
print(round(float(BulletPrior().predict(scene, make_push(0.0, 0.0, 0.1))[0, 0] - scene[0, 0]), 2))
try:
    check_engine("bullet")
except ConfigError as error:
    print(error)
"""


def test_without_pybullet_mujoco_is_the_engine_and_what_brings_it_is_told():
    """Where Python is above 3.11, PyBullet has no wheel and the set-up leaves it out."""
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT_BULLET], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    engine, moved, refusal = run.stdout.splitlines()
    assert engine == "mujoco"
    assert 0.06 < float(moved) < 0.15  # [m], about as far as the tool travelled
    assert "needs the package pybullet, which is not installed" in refusal
    assert "pip install pybullet==" in refusal
