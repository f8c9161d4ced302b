"""Results of gym-pusht: in the terminal, in files, and on the page of all results."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from sain_eval.loop.results_page import read_results, results_page
from sain_pusht import commands, evaluation
from sain_pusht.evaluation import PushtOptions, PushtRecord, run, write_pusht_results


def records(model: str) -> list[PushtRecord]:
    return [
        PushtRecord(
            "gym-pusht", seed, model, 0.0008, seed > 0, 4 + seed, 0.001, (0.001, 0.003), 0,
            "" if seed else "no steps are left", within="95 % covered", has_heading=True,
            steps=40 + seed, free_steps=10, coverage=0.9,
        )
        for seed in range(3)
    ]  # fmt: skip


def test_gym_pusht_is_a_reality(tmp_path: Path) -> None:
    for model in ("pusht", "oracle"):
        (tmp_path / model).mkdir()
        write_pusht_results(tmp_path / model, records(model), {}, f"pusht --model {model}")
    results = [read_results(tmp_path / name) for name in ("pusht", "oracle")]
    lines = results_page(results, {}).replace("\u00a0", " ").splitlines()
    assert "| scenario | within | SAIN trained there | oracle |" in lines
    assert "| `gym-pusht` | 95 % covered | 2/3, 5.5 | 2/3, 5.5 |" in lines
    cell = "**2/3** (21-94 %), 5.5 pushes, 41.0 steps, 2.0 mm"
    assert f"| 95 % covered | SAIN trained there | {cell} |" in lines
    assert "pusht --model oracle" in lines


def test_the_command_goes_on_and_prints_steps_and_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    played: list[int] = []

    def run_on(work, jobs, options):  # type: ignore[no-untyped-def]
        for job in jobs:
            played.append(job.seed)
            yield [records(job.model)[job.seed]]

    monkeypatch.setattr(evaluation, "run_on", run_on)
    monkeypatch.setattr(evaluation, "_load", lambda model: None)
    for episodes in (1, 3):
        text = StringIO()
        options = PushtOptions(out=tmp_path, episodes=episodes, film=False)
        run(options, Console(file=text, width=200))
    assert played == [0, 1, 2]
    shown = text.getvalue()
    assert "gym-pusht" in shown and "2/3" in shown
    assert "steps: mean 41.0 [" in shown and "24 % without contact" in shown
    assert "gym-pusht 0, pusht, not within 95 % covered: no steps are left; 4 pushes" in shown


def test_gym_pusht_that_is_not_installed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "gym_pusht", None)
    assert commands.evaluate(["--out", str(tmp_path)]) == 1
    error = " ".join(capsys.readouterr().err.split())
    assert error.startswith("evaluate: gym-pusht cannot be imported (")
    assert error.endswith("; pip install gym-pusht gymnasium")
