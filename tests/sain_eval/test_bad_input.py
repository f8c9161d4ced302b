"""What cannot be is an error of one line: what was wrong, what is allowed, what to do."""

import pytest

from sain_eval import commands


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
