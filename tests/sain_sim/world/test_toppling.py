"""A body that tips over is no outcome in a plane, in any engine; what is too thin is refused."""

import json

import pytest

from sain_core.errors import ConfigError
from sain_core.push import make_push
from sain_core.randomness import generator
from sain_core.world import ToppledError
from sain_sim import commands
from sain_sim.collecting.collect import CollectConfig, account, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeRunner, draw_parameters
from sain_sim.collecting.shards import PushCounts
from sain_sim.world.parameters import WorldParameters, check_stands
from sain_sim.world.roughness import Roughness
from sain_sim.world.world import World

RULER = "shapes:\n  ruler: [[-0.1, -0.002], [0.1, -0.002], [0.1, 0.002], [-0.1, 0.002]]\n"
ONE_SIDED = Roughness(mass_offsets=((0.0, 0.09),))  # the centre of mass is near the supports' edge


def bar(bottom: str = "", friction: float = 0.2, **changes: object) -> WorldParameters:
    one: dict[str, object] = {"masses": (8.0,), "radii": (0.06,), "roles": ("pushable",)}
    return WorldParameters(shapes=(f"bar{bottom}",), friction=friction, **(one | changes))  # type: ignore[arg-type]


def test_a_push_that_tips_a_body_over_is_refused_and_nothing_has_moved(engine):
    with World(bar(roughness=ONE_SIDED), engine=engine) as world:
        scene = world.observe()
        with pytest.raises(ToppledError, match=r"tips over body 0 \(bar\): it leans by \d+ deg"):
            world.push(make_push(1.57, 0.0, 0.1))
        assert (world.observe() == scene).all()
    with World(bar(radii=(0.08,)), engine=engine) as world:
        assert world.push(make_push(1.57, 0.0, 0.1)).settled


@pytest.mark.parametrize("bottom", ["", ":flat"])
def test_a_body_too_thin_for_its_height_is_refused_with_the_least_width(engine, bottom):
    message = r"8 mm wide and 40 mm high: it tips over .* 20 mm above .* friction 0.20; make it ab"
    with pytest.raises(ConfigError, match=message) as error:
        World(bar(bottom, radii=(0.02,)), engine=engine)
    least = float(str(error.value).split("about ")[1].split()[0])
    World(bar(bottom, radii=(0.02 * (least + 0.5) / 7.85,)), engine=engine).close()


def test_collect_names_a_ruler_that_cannot_be_pushed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    (tmp_path / "sain/shapes").mkdir(parents=True)
    (tmp_path / "sain/shapes/ruler.yaml").write_text(RULER)
    given = "--episodes 1 --parameters wide --shapes ruler:flat --bodies 1 --workers 1 --out"
    assert commands.collect([*given.split(), str(tmp_path / "data")]) == 1
    error = " ".join(capsys.readouterr().err.split())
    assert "mm wide and 40 mm high: it tips over when it is pushed 20 mm above a table" in error


def test_what_tips_over_is_no_valid_push_and_ends_its_episode(tmp_path, monkeypatch):
    draw = EpisodeRunner.run.__globals__["draw_parameters"]
    monkeypatch.setitem(
        EpisodeRunner.run.__globals__,
        "draw_parameters",
        lambda *given: bar(roughness=ONE_SIDED) if len(given) > 2 else draw(*given),
    )
    episode = EpisodeConfig(pushes=5, shapes="bar", bodies="1")
    done = collect(CollectConfig(tmp_path, 4, 3, episode=episode, workers=1))
    assert done.counts.toppled >= 3 and done.counts.stuck == done.counts.edge == 0
    assert done.transitions == done.counts.valid < 8
    lines = [json.loads(line) for line in (tmp_path / "episodes.jsonl").read_text().splitlines()]
    assert all(line["toppled"] <= 1 for line in lines)


def test_worlds_in_which_a_body_would_tip_are_drawn_again_and_counted():
    episode = EpisodeConfig(shapes="bar", bodies="3", parameters="wide")
    counts, random = PushCounts(), generator(0, "redraw")
    for _ in range(20):
        check_stands(draw_parameters(random, episode, counts))
    assert counts.redrawn > 0
    lines = account(counts, CollectConfig(episodes=1, episode=episode))
    assert f"{counts.redrawn} worlds were drawn again: a body would tip over" in "".join(lines)


def test_a_body_that_is_high_for_its_width_tips_when_it_is_pushed_fast():
    ends, slow, fast = [], *(make_push(1.57, 0.0, 0.1, speed=speed) for speed in (0.1, 0.2))
    for height in (0.04, 0.12):  # 31 mm wide
        with World(bar(":flat", radii=(0.08,), heights=(height,)), engine="mujoco") as world:
            scene = world.observe()
            ends.append(world.push(slow).after)
            world.reset(scene)
            if height == 0.04:
                assert world.push(fast).settled
                continue
            with pytest.raises(ToppledError, match=r"by 9\d degrees, .* bodies of 120 mm must"):
                world.push(fast)
    assert abs(ends[1] - ends[0])[0, :2].max() < 0.003 < abs(ends[0] - scene)[0, :2].max()


def test_heights_that_no_world_can_have_are_refused():
    with pytest.raises(ConfigError, match="1 bodies have 2 heights"):
        bar(heights=(0.1, 0.1))
    with pytest.raises(ConfigError, match=r"heights\[0\] is 0.01 m; it must be at least 0.025 m"):
        bar(heights=(0.01,))
    bullet = pytest.importorskip("pybullet") and "bullet"
    with pytest.raises(ConfigError, match=r"is 80 mm high; in engine bullet .* use engine mujoco"):
        World(bar(heights=(0.08,)), engine=bullet)
