"""Recordings of a laboratory become a belief; those of two do not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sain_core.errors import CheckpointError, ConfigError
from sain_core.model import Model, load_dynamics
from sain_core.push import make_stroke
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import describe_bodies
from sain_core.types import Pushes, Scenes
from sain_model import commands
from sain_model.cli.identify import IdentifyOptions, run
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.identify import fit_laboratory, identify_bodies, observed_pushes
from sain_model.inference.kinds import FRICTION, NO_AXES, read_belief
from sain_model.physics.parameters import TEXTBOOK, PlanarConfig
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.rolling import write_shard

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
EPISODES, PUSHES = 10, 5
LAB = replace(TEXTBOOK, tool_friction=0.25, inertia=0.42)


def record(folder: Path, draw: Draw, config: PlanarConfig, seed: int, column: str = "") -> Path:
    """Write what a laboratory shows: each episode has a friction of its own."""
    scenes, pushes = draw(EPISODES * PUSHES, seed)
    random = np.random.default_rng(seed)
    episode = np.repeat(np.arange(EPISODES), PUSHES)
    friction = random.uniform(0.08, 0.2, EPISODES)[episode]
    after = PlanarPrior(config).step(scenes, pushes, {FRICTION: friction})
    after[..., :2] += random.normal(0, 1e-4, after[..., :2].shape)
    known = {column: friction} if column else {}
    return write_shard(folder, scenes, pushes, after, episode=episode + 40, **known)


def believing(name: str, belief: Path) -> Model:
    return load_dynamics(name).with_belief(belief)


@pytest.fixture
def recording(tmp_path, random_pushes):
    return record(tmp_path / "lab", random_pushes, LAB, 11, column="friction")


def test_parameters_are_recovered_with_a_friction_for_each_episode(recording):
    sain = load_dynamics("sain")
    kind = sain.belief.kinds[1]
    found = fit_laboratory(kind, observed_pushes(load_dataset(recording)))
    values = kind.values(found.mean[None])
    assert values["tool_friction"] == pytest.approx(0.25, rel=0.05)
    assert values["inertia"] == pytest.approx(0.42, rel=0.1)
    own = dict(zip(kind.names, found.own, strict=True))
    assert max(own["tool_friction"], own["inertia"]) < 0.5 * own[FRICTION]  # which varies
    with np.load(recording / "shard-0.npz") as shard:
        truth = shard["friction"][::PUSHES]
    np.testing.assert_allclose(kind.values(found.places)[FRICTION], truth, rtol=0.05)


def test_identify_writes_a_belief_that_models_begin_with(recording, tmp_path):
    out = tmp_path / "belief.json"
    console = Console(record=True, width=200)
    run(IdentifyOptions((recording,), out), console)
    text = console.export_text()
    assert "tool_friction" in text
    assert f"{EPISODES * PUSHES} pushes of {EPISODES} episodes; written to" in text
    belief = read_belief(out)
    assert belief.card["source"] == {str(recording): EPISODES * PUSHES}
    assert belief.likeliest.name == NO_AXES
    usual, informed = load_dynamics("sain"), believing("sain", out)
    assert informed.value("tool_friction") == pytest.approx(0.25, rel=0.05)
    assert not informed.corrects
    data = observed_pushes(load_dataset(recording))[0]
    off = [
        np.linalg.norm((m.step(data.state, data.action) - data.next_state)[..., :2], axis=-1)
        for m in (usual, informed)
    ]
    assert off[1].mean() < 0.9 * off[0].mean()
    with pytest.raises(ConfigError, match="model 'planar' takes no belief"):
        believing("planar", out)


def test_recordings_of_two_laboratories_are_an_error(recording, tmp_path, random_pushes, capsys):
    other = record(tmp_path / "other", random_pushes, replace(LAB, tool_friction=0.08), 12)
    options = IdentifyOptions((recording, other), tmp_path / "belief.json")
    message = f"{recording} and {other} disagree about tool_friction"
    arguments = [str(recording), str(other), "--out", str(options.out)]
    assert commands.identify(arguments) == 1
    assert not options.out.exists()
    error = " ".join(capsys.readouterr().err.split())
    assert error.startswith(f"identify: {message}")
    assert error.endswith("standard deviations apart; identify each laboratory by itself")


def name_bodies(out: Path, touched: bool = True) -> Path:
    """Write strokes against a disk on five surfaces, of a tool that may miss."""
    count = 5 * PUSHES
    scenes = np.zeros((count, 1, 8))
    scenes[:, 0, 6:] = 1.0, 0.05
    bearing = np.linspace(0.0, 6.0, count)
    start = 0.08 * np.column_stack([np.cos(bearing), np.sin(bearing)])
    away = bearing + (np.pi + 0.3 if touched else 0.0)
    strokes = make_stroke(start, away, 0.06, speed=0.02, tip_radius=0.005)
    bodies = Bodies.named(["disk:flat"])
    after = PlanarPrior(PlanarConfig(), bodies).step(scenes, strokes)
    named = describe_bodies(bodies)
    text = {"object": "puck", "shapes": named["shapes"], "roles": named["roles"]}
    columns = {name: np.full(count, value) for name, value in text.items()}
    columns["surface"] = np.repeat([f"table {number}" for number in range(5)], PUSHES)
    return write_shard(out, scenes, strokes, after, episode=np.arange(count), **columns)


def test_what_pushes_do_not_show_stays_as_uncertain_as_before(tmp_path):
    shown = {}
    for touched in (True, False):
        data = name_bodies(tmp_path / f"{touched}", touched)
        belief = identify_bodies(load_dataset(data))
        shown[touched] = dict(zip(belief.likeliest.names, belief.likeliest.deviations, strict=True))
    assert min(shown[False].values()) >= 1.0
    assert shown[True]["centre_x"] < 0.8 * shown[False]["centre_x"]


def test_as_many_pushes_of_each_named_body_count_as_are_given(tmp_path, recording, capsys):
    data, out = str(name_bodies(tmp_path / "robot")), ["--out", str(tmp_path / "belief.json")]
    assert commands.identify([data, *out, "--pushes", "2"]) == 0
    assert "10 pushes of 5" in capsys.readouterr().out
    for given, message in (
        ([data], "is given twice; give each recording once"),
        ([str(recording)], "some of the pushes name their body"),
        (["--model", "nonsense"], "--model is 'nonsense'; it is for recordings of a laboratory"),
    ):
        assert commands.identify([data, *given, *out]) == 1
        assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("content", ["", "{}", '{"format": "sain-belief-2", "structures": []}'])
def test_a_file_that_is_no_belief_is_refused(tmp_path, content):
    path = tmp_path / "belief.json"
    path.write_text(content)
    with pytest.raises(CheckpointError, match=r"cannot be read.*ros2 run sain_model identify"):
        read_belief(path)
