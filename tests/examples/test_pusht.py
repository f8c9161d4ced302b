"""The package of `examples/pusht`: it is played by name, and keeps what gym-pusht does."""

import json
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

from sain_bringup.graph import executable
from sain_core.conformance import check_world
from sain_core.errors import InvalidInputError, UnreachableError
from sain_core.push import PushLimits, make_push, strokes
from sain_core.scene import THETA
from sain_core.shapes.bodies import Bodies
from sain_core.world import DivergedError, Setting
from tests.examples.installing import install, run
from tests.paths import ROOT

pytest.importorskip("gym_pusht")

SPEED = 0.32  # [m/s]
WALLED = 8  # seed of an episode in which the block shuts off a corner of the room


@pytest.fixture(scope="module")
def pusht():
    """The modules of the package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "examples" / "pusht")
        names = ("block", "model", "motion", "scenario", "world")
        yield SimpleNamespace(**{name: import_module(f"pusht.{name}") for name in names})


@pytest.fixture
def begun(pusht):
    """Begin the episode of a seed: return its world and its setting."""

    def begin(seed: int):
        case, world = pusht.scenario.SCENARIO.scene(seed), pusht.world.load("gym-pusht")
        setting = Setting(case.disks, pusht.block.T.bodies, case.friction)
        world.reset(setting)
        return world, setting

    return begin


def possible_push(pusht, world, random: np.random.Generator) -> np.ndarray:
    """Draw a push that the world accepts, and that the model takes to move the block."""
    scene, model = world.observe(), pusht.model.load("pusht")
    pushes = PushLimits().sample(random, 64, np.full(64, SPEED))
    predicted = model.step(np.repeat(scene[None], 64, axis=0), pushes)
    for push in pushes[np.abs(predicted - scene).max(axis=(1, 2)) > 0.02]:
        with suppress(UnreachableError):
            world._targets(push, scene)
            return push
    raise AssertionError("no push is possible")


def test_evaluate_plays_it_by_name_to_its_own_measure(tmp_path):
    environment = install("pusht", tmp_path)
    names = ["--engine", "gym-pusht", "--scenario", "gym-pusht", "--controllers", "pusht"]
    planner = ["--planner.speeds", str(SPEED), "--planner.correction-speed", str(SPEED)]
    few = ["--planner.samples", "256", "--planner.horizon", "2", "--tolerances", "0.01"]
    command = [str(executable("sain_eval", "evaluate")), *names, *planner, *few]
    out = tmp_path / "results"
    said = run(environment, command, "--scenes", 1, "--workers", 1, "--out", out)
    (row,) = json.loads((out / "results.json").read_text())["summary"]
    assert row["successes"] == 1 and row["within"] == "95 % covered" and row["within"] in said
    assert 2.0 < row["seconds"] < 10.0
    page = tmp_path / "page.md"
    run(environment, [str(executable("sain_eval", "results")), str(out), "--out", str(page)])
    assert "### gym-pusht" in page.read_text()
    assert f"{row['seconds']:.1f} s," in page.read_text()


def test_the_world_keeps_the_contract_and_the_episode_of_the_seed(pusht, begun):
    world, setting = begun(3)
    push = possible_push(pusht, world, np.random.default_rng(0))
    check_world(world, setting, push)
    again, _ = begun(3)
    gym = pusht.world.make_env()
    gym.reset(seed=3)
    np.testing.assert_allclose(again.env.agent.position, gym.agent.position)
    np.testing.assert_allclose(again.env.block.position, gym.block.position)
    outcome = again.push(push)
    assert outcome.duration == pytest.approx(again.steps / gym.control_hz)


def test_models_predict_what_gym_pusht_does(pusht, begun):
    random, off = np.random.default_rng(1), {"pusht": [], "pusht_oracle": []}
    models = {name: pusht.model.load(name) for name in off}
    for seed in (2, 3, 5, 6, 13):
        world, _ = begun(seed)
        push = possible_push(pusht, world, random)
        outcome = world.push(push)
        for name, model in models.items():
            (predicted,) = model.step(outcome.before[None], push[None])
            off[name].append(np.abs(predicted - outcome.after)[0, : THETA + 1].max())
    assert np.median(off["pusht"]) < 0.005  # [m] and [rad]
    assert np.median(off["pusht_oracle"]) < 1e-3


def test_success_is_that_of_gym_pusht(pusht, begun):
    world, setting = begun(4)
    goal, (x, y, angle) = pusht.scenario.SCENARIO.scene(4).goal, world.env.goal_pose
    for away in (0.0, 2.0, 4.0, 40.0):
        scene = pusht.block.T.scene_of(np.array([x + away, y, angle]))
        world.reset(Setting(scene, setting.bodies, setting.friction))
        judged = goal.within(1e-6, 1e-6).judge(scene, setting.scene, setting.bodies)
        assert judged.share == pytest.approx(world.env._get_coverage(), abs=1e-6)
        assert judged.reached == (world.env._get_coverage() > world.env.success_threshold)


def test_a_refused_push_leaves_the_episode_as_it_is(pusht, begun):
    world, setting = begun(3)
    moved = world.push(possible_push(pusht, world, np.random.default_rng(0)))
    steps, place = world.steps, tuple(world.env.agent.position)
    with pytest.raises(UnreachableError, match="into a wall of gym-pusht"):
        for location in np.linspace(-3.0, 3.0, 20):
            world.env.block.position = (450.0, 256.0)
            world._note()
            world.push(make_push(location, 0.0, 0.15, speed=SPEED))
            steps, place = world.steps, tuple(world.env.agent.position)
    world.reset(Setting(world.observe(), setting.bodies, setting.friction))
    assert (world.steps, tuple(world.env.agent.position)) == (steps, place)
    assert not np.array_equal(moved.after, setting.scene)
    world.reset(setting)
    assert world.steps == 0


def test_what_is_wrong_is_said_before_anything_moves(pusht, begun):
    world, setting = begun(3)
    disk = Setting(setting.scene, Bodies.disks(1), setting.friction)
    with pytest.raises(InvalidInputError, match="gym-pusht has one 'pusht_t'"):
        world.reset(disk)
    with pytest.raises(InvalidInputError, match="the seed of gym-pusht is 1000000; allowed: 0 to"):
        pusht.scenario.SCENARIO.scene(1_000_000)
    world.steps = 300
    with pytest.raises(DivergedError, match="gym-pusht ends an episode after 300 steps"):
        world.push(make_push(0.0, 0.0, 0.05, speed=SPEED))


def test_no_path_leads_to_a_corner_that_is_shut_off(pusht, begun):
    world, _ = begun(WALLED)
    scene, limits = world.observe(), PushLimits()
    pushes = limits.sample(np.random.default_rng(0), 100, np.full(100, SPEED))
    scenes = np.repeat(scene[None], 100, axis=0)
    starts = pusht.block.pixels(strokes(scenes, pushes, limits, pusht.block.T.bodies)[0])
    shut = world.room.shut_off(starts, np.repeat(world._outline[None], 100, axis=0))
    shut &= world.room.contains(starts)
    assert 0 < shut.sum() < 50
    predicted = pusht.model.load("pusht").step(scenes[shut], pushes[shut])
    np.testing.assert_array_equal(predicted, scenes[shut])
    for push in pushes[shut]:
        with pytest.raises(UnreachableError):
            world.push(push)


@pytest.fixture
def varied(pusht):
    """The module of stable-worldmodel's Push-T."""
    if find_spec("stable_worldmodel") is None:
        pytest.skip("stable-worldmodel is not installed")
    return import_module("pusht.varied")


def test_the_agent_reaches_a_goal_of_stable_worldmodel_from_states(varied):
    world = varied.begin_episode([*varied.STARTS, "block.shape", "agent.scale"], seed=3)
    import_module("pusht.aims").play_episode(world)
    *_, success, _, _ = world.env.step(np.zeros(2, dtype=np.float32))
    assert success and world.done and 0 < world.success <= world.steps < 150


def test_it_reaches_one_from_pictures_whose_colours_it_has_not_seen(varied):
    colours = [f"{name}.color" for name in ("agent", "block", "goal", "background")]
    world = varied.begin_episode([*varied.STARTS, *colours], seed=5, pictures=True)
    import_module("pusht.aims").play_episode(world)
    assert world.done and 0 < world.success < 100


def test_the_press_of_an_agent_that_is_no_disk_is_predicted(varied):
    world = varied.begin_episode([*varied.STARTS, "agent.shape"], seed=3)
    assert isinstance(world, varied.SlowWorld)
    begun, toward = world.observe(), world._scene[0, :2] - world._agent[0, :2]
    for _ in range(12):
        target = world._agent[0, :2] + 0.08 * toward / np.abs(toward).max()
        expected = world._presses.follow(world._agent[0, :3], world._scene[0], target)
        world._step(varied.pixels(target))
        np.testing.assert_allclose(world._scene[0, :3], expected[1], atol=4e-3)
    assert np.abs(world.observe() - begun)[0, :3].max() > 0.02
