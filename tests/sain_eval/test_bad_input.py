"""What cannot be is an error of one line: what was wrong, what is allowed, what to do."""

import numpy as np
import pytest

from sain_core.scene import POSITION, TARGET
from sain_eval import commands
from sain_eval.scenes.scenarios import SCENARIOS
from sain_sim.world.workcell import Workcell


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("--noise 0.2,0", "noise has a standard deviation of 0.2 m; allowed: 0 to 0.02 m, with wh"),
        ("--delay 2", "--delay is 2.0 s; it must be at most 0.5 s"),
        ("--scenario somewhere", "scenario 'somewhere' is unknown; known: anywhere,"),
        ("--tolerances 0", "--tolerances has 0.0 m; allowed"),
        ("--tolerances near", "allowed: numbers with commas, or pairs as 0.02:0.1"),
        ("--tolerances 0.02:9", "--tolerances has 9.0 rad; allowed: above 0, at most 5.0 rad"),
        ("--controllers ,", "--controllers is empty; at least one is needed"),
        ("--scenes 0", "--scenes is 0; it must be at least 1"),
    ],
)
def test_options_that_cannot_be(words, error, tmp_path, capsys):
    assert commands.evaluate([*words.split(), "--out", str(tmp_path)]) in (1, 2)  # 2: of options
    said = " ".join(capsys.readouterr().err.split())
    assert said.startswith("evaluate: ") and error in said and "Traceback" not in said


def test_a_policy_of_other_bodies_is_named_with_its_scene_before_an_episode(tmp_path, capsys):
    """`clutter` has 3 to 5 bodies, by the seed; the first scenario fits."""
    count = len(SCENARIOS["clutter"].scene(4).disks)
    arguments = ["--controllers", "null,policy:tests.policies:of_two", "--scenes", "1"]
    arguments += ["--scenario", "paper,clutter", "--seed", "4", "--out", str(tmp_path)]
    assert commands.evaluate(arguments) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "policy tests.policies:of_two in scene 4 of scenario clutter observes" in said
    assert f"observation.state (16,); there are, with {count} bodies, observation.state" in said
    assert not list(tmp_path.iterdir())


def test_noise_that_hides_the_tolerance_is_the_reason_of_the_failure(tmp_path, capsys):
    arguments = ["--scenario", "paper", "--scenes", "1", "--controllers", "planar"]
    arguments += ["--noise", "0.02,0.35", "--bias", "0.02,0.35", "--out", str(tmp_path)]
    assert commands.evaluate(arguments) == 0
    shown = capsys.readouterr().out
    assert "the tolerances are too small for what is observed: poses have standard dev" in shown
    assert "choose wider tolerances" in shown


def test_an_engine_that_explodes_is_the_reason_of_the_failure(tmp_path, capsys, monkeypatch):
    true_scene = Workcell.observe

    def exploded(cell: Workcell) -> np.ndarray:
        scene = true_scene(cell)
        if not cell.unmoved:
            scene[TARGET, POSITION] += 1e6
        return scene

    monkeypatch.setattr(Workcell, "observe", exploded)
    arguments = ["--scenario", "paper", "--scenes", "1", "--controllers", "straight"]
    assert commands.evaluate([*arguments, "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "DivergedError: the engine found no solution of the push: body 1 would end" in shown
    assert "possible are 2 m; 0 pushes" in shown
