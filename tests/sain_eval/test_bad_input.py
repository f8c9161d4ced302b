"""What cannot be is an error of one line: what was wrong, what is allowed, what to do."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sain_core.scene import POSITION, TARGET
from sain_eval import commands
from sain_mppi.objective import cost
from sain_sim.world.workcell import Workcell


def said(run, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command says about an error."""
    assert run(arguments) in (1, 2)  # 2: of options
    error = capsys.readouterr().err
    assert "Traceback" not in error
    return " ".join(error.split())


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (
            "--noise 0.2,0",
            "evaluate: noise has a standard deviation of 0.2 m; allowed: 0 to 0.02 m, with which"
            " a body is still where it is seen",
        ),
        (
            "--bias 0,1",
            "evaluate: bias has a standard deviation of 1 rad; allowed: 0 to 0.35 rad, with which"
            " a body is still where it is seen",
        ),
        ("--delay 2", "evaluate: --delay is 2.0 s; it must be at most 0.5 s"),
    ],
)
def test_noise_and_delay_that_cannot_be(words, error, tmp_path, capsys):
    assert said(commands.evaluate, [*words.split(), "--out", str(tmp_path)], capsys) == error


def test_noise_that_hides_the_tolerance_is_the_reason_of_the_failure(tmp_path, capsys):
    arguments = ["--scenario", "paper", "--scenes", "1", "--controllers", "planar"]
    arguments += ["--noise", "0.02,0.35", "--bias", "0.02,0.35", "--out", str(tmp_path)]
    assert commands.evaluate(arguments) == 0
    shown = capsys.readouterr().out
    assert "the tolerances are too small for what is observed: poses have standard dev" in shown
    assert "choose wider tolerances" in shown


def test_a_cost_that_is_never_finite_ends_the_evaluation(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cost, "further_terms", lambda more: [("mine", 1.0)])
    entry = EntryPoint("mine", "my_parts:mine", "sain.costs")
    nan = (entry, lambda rollout, objective: np.full(len(rollout.moving), np.nan))
    monkeypatch.setattr(cost, "find_cost", lambda name: nan)
    arguments = ["--scenario", "paper", "--scenes", "2", "--controllers", "planar"]
    error = said(commands.evaluate, [*arguments, "--out", str(tmp_path)], capsys)
    assert "evaluate: cost 'mine' of the package of my_parts: it is NaN for" in error


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
