import importlib.util
import subprocess
import sys

import pytest

from sain_core.errors import ConfigError
from sain_sim.commands import collect as main
from sain_sim.world import engines
from sain_sim.world.engines import BULLET, ENGINES, MUJOCO, check_engine, simulation_class
from sain_sim.world.truth import MEASURED, ROUGH, TruthConfig, check_effects, effects_of
from sain_sim.world.workcell import Simulation

MISSING = (
    "engine mujoco needs the package mujoco, which is not installed:"
    ' pip install "sain_sim[mujoco]", or pip install mujoco'
)


@pytest.fixture
def without_mujoco(monkeypatch):
    def find(name):
        return None if name == "mujoco" else importlib.util.find_spec(name)

    monkeypatch.setattr(engines, "find_spec", find)


def test_an_engine_is_found_by_name(engine):
    assert issubclass(simulation_class(engine), Simulation)


def test_bullet_is_the_default_and_has_all_effects_of_a_rough_world():
    assert TruthConfig().engine == BULLET == next(iter(ENGINES))
    check_effects(BULLET, effects_of(ROUGH))


def test_an_engine_without_an_effect_names_those_that_have_all():
    check_effects(MUJOCO, effects_of(MEASURED))
    message = "engine bullet cannot simulate pressure, soft, offset, noise; use engine mujoco, or"
    with pytest.raises(ConfigError, match=f"{message} effects without pressure, soft, offset"):
        TruthConfig(MEASURED)
    with pytest.raises(ConfigError, match="bullet cannot simulate soft; use effects without"):
        check_effects(BULLET, ("soft", "direction"))
    with pytest.raises(ConfigError, match=r"mine cannot simulate mass; use .* effects none"):
        check_effects("mine", ("mass",))


def test_an_engine_that_is_not_installed_is_an_error_that_names_the_extra(without_mujoco):
    with pytest.raises(ConfigError) as caught:
        check_engine(MUJOCO)
    assert str(caught.value) == MISSING
    check_engine(BULLET)


def test_a_command_says_so_before_anything_is_made(without_mujoco, tmp_path, capsys):
    out = tmp_path / "data"
    assert main(["--out", str(out), "--engine", "mujoco"]) == 2
    assert capsys.readouterr().err.strip().replace("\n", " ") == f"collect: {MISSING}"
    assert not out.exists()


def test_an_engine_that_does_not_exist_is_refused():
    with pytest.raises(ConfigError, match="engine 'ode' is unknown; known: bullet, mujoco"):
        check_engine("ode")
    with pytest.raises(ConfigError, match="engine 'ode' is unknown; known: bullet, mujoco"):
        TruthConfig(engine="ode")


def test_a_world_in_bullet_does_not_load_mujoco(tmp_path):
    import subprocess

    program = "import sys; from sain_sim.world.world import World; from sain_sim.world.parameters"
    program += " import nominal_parameters as n; World(n()); assert 'mujoco' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


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
    assert "./env pip install -r requirements/bullet.txt" in refusal
