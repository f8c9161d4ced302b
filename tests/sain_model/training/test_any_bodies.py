"""Training, fine-tuning and evaluation on pushes of any body of scenes of any shapes."""

import pytest

from sain_model import commands
from sain_model.dynamics.load import load_checkpoint
from tests.sain_model.conftest import read_card

SMALL = ("--hidden", "8", "--message", "4", "--members", "2", "--epochs", "2", "--batch", "16")
OWN = ("--prior", "planar_axes", "--validation", "0.2", "--test", "0.2")


@pytest.fixture(scope="module")
def trained(any_bodies, tmp_path_factory):
    out = tmp_path_factory.mktemp("trained")
    assert commands.train([str(any_bodies), "--out", str(out), *SMALL, *OWN]) == 0
    return out / "sain.safetensors"


def test_the_card_states_errors_by_group_and_by_shape(trained):
    card = read_card(trained)
    assert card.prior == "planar_axes"
    assert card.friction is not None
    assert card.intervals is not None
    errors = card.errors["after"]["1"]["errors"]
    pushed, prior = (errors["pushed"][name] for name in ("SAIN, history", "its prior, history"))
    assert pushed["number"] == card.errors["transitions"] == card.data["transitions"]["test"]
    assert 0.0 < prior["mm"][0] < 10.0
    ratio = card.errors["after"]["1"]["ratios"]["pushed"]["SAIN, history"]["its prior, history"]
    assert ratio["mm"][1] <= pushed["mm"][0] / prior["mm"][0] <= ratio["mm"][2]
    assert 0.5 < pushed["coverage"][0] <= 1.0
    shapes = {name: one for name, one in errors.items() if name.startswith("pushed ")}
    assert set(shapes) <= {"pushed t", "pushed bar", "pushed disk"}
    assert card.bottoms == ["feet"]
    assert errors["in bullet randomised, feet"] == errors["pushed"]
    assert card.data["worlds"]["test"] == {"bullet randomised, feet": pushed["number"]}
    total = sum(shape["SAIN, history"]["number"] for shape in shapes.values())
    assert total == pushed["number"]


def test_fine_tuning_goes_on_with_pushes_of_any_body(
    any_bodies, more_bodies, trained, tmp_path, capsys
):
    short = ("--epochs", "1", "--test", "0.3", "--validation", "0.3")
    tuned = [str(more_bodies), "--from", str(trained), "--out", str(tmp_path / "tuned"), *short]
    assert commands.train(tuned) == 0
    assert "pushed bodies: mean error on the test episodes" in capsys.readouterr().out
    card = read_card(tmp_path / "tuned" / "sain.safetensors")
    assert card.errors["fine_tuning"]["bodies"] == "pushed bodies"
    assert (
        load_checkpoint(tmp_path / "tuned" / "sain.safetensors").network.weights.config.members == 2
    )
    again = [str(any_bodies), "--from", str(trained), "--out", str(tmp_path / "again")]
    assert commands.train(again) == 1
    assert "has learned from this data set already" in " ".join(capsys.readouterr().err.split())
