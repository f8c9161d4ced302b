"""A network learns on the physics that was identified: what becomes of it, what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sain_model import commands
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import load_checkpoint
from sain_model.evaluation.errors import inferred_rows
from sain_model.inference.kinds import FRICTION, Belief, Kind, write_belief
from sain_model.physics.parameters import AXES, TEXTBOOK
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import read_card

SMALL = ("--hidden", "8", "--message", "4", "--epochs", "2")
LAB = replace(TEXTBOOK, friction=0.15, tool_friction=0.2)
NARROW = 0.4  # standard deviation of z


def run(*arguments: object) -> int:
    return commands.train([str(argument) for argument in arguments])


def believe(path: Path, log_odds: float = 0.0) -> Path:
    """Write a belief in a laboratory; negative odds: in a solver's axes."""
    names, spread = (FRICTION, "tool_friction"), np.diag([NARROW**2, 0.01])
    lab = Kind("textbook", PlanarPrior(LAB), names, spread, log_odds)
    axes = Kind("solver axes", PlanarPrior(AXES), names, np.eye(2), corrected=True)
    return write_belief(path, Belief((axes, lab)))


def test_the_likeliest_physics_is_the_prior(dataset, tmp_path):
    belief = believe(tmp_path / "belief.json", 1.0)
    assert run(dataset, "--belief", belief, "--out", tmp_path / "out", *SMALL) == 0
    path = tmp_path / "out" / "sain.safetensors"
    model, card = load_checkpoint(path), read_card(path)
    assert model.belief.trained.config == LAB
    assert (model.belief.trained.names, model.origin.prior_name) == ((FRICTION,), "planar")
    assert card.training["prior"] == "planar"
    assert model.belief.trained.deviations[0] == pytest.approx(NARROW)
    assert model.network.intervals is not None


def test_a_network_on_the_physics_of_use_corrects_whatever_earlier_pushes_show(dataset, tmp_path):
    out = tmp_path / "out"
    assert run(dataset, "--history", "earlier", "--believed", "--out", out, *SMALL) == 0
    model = load_checkpoint(out / "sain.safetensors")
    assert all(kind.corrected for kind in model.belief.kinds)
    assert "centre_x" in model.belief.trained.names
    part = load_dataset(dataset).alike
    rows = inferred_rows(model, part)
    physics, corrected = model.step_rows(part.state, part.action, rows)
    assert rows.corrected.all() and (physics != corrected).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--prior", "identity"], "--prior is 'identity'; the physics of"),
        (["--prior", "planar_axes"], "is a 'planar': leave --prior out"),
        (["--from", "sain"], "--belief is for new weights"),
        (["--history", "earlier"], "--history is 'earlier', by which pushes show what --belief"),
    ],
)
def test_what_contradicts_the_belief_is_refused(options, message, dataset, tmp_path, capsys):
    belief = believe(tmp_path / "belief.json", 1.0)
    assert run(dataset, "--belief", belief, "--out", tmp_path / "out", *options) == 1
    assert message in " ".join(capsys.readouterr().err.split())
