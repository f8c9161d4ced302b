"""What `benchmarks.gates` prints: ok, open or worse, and figures that can be read again."""

from dataclasses import replace

import pytest

from benchmarks.gates.table import Baseline, Gate, print_gates

NONE = Baseline("", {})
SOLVED = Gate("solved", 0.9, interval=(0.6, 1.0), more_is_better=True)


def line(capsys: pytest.CaptureFixture[str], gate: Gate, before: Gate | None) -> str:
    """The last cell of the line that is printed for a gate beside a baseline."""
    sound = print_gates("group", [gate], Baseline("abc", {gate.name: before}) if before else NONE)
    row = next(one for one in capsys.readouterr().out.splitlines() if gate.name in one)
    verdict = row.strip("│ ").split("│")[-1].strip()
    assert sound == (verdict != "worse")
    return verdict


@pytest.mark.parametrize(
    ("gate", "before", "verdict"),
    [
        (Gate("lines", 27_000, at_most=27_000), None, "ok"),
        (Gate("lines", 27_001, at_most=27_000), None, "open"),
        (Gate("lines", 27_001, at_most=27_000), 30_000, "open"),
        (Gate("lines", 30_001, at_most=27_000), 30_000, "worse"),
        (Gate("plan", 33.9, "ms", slack=0.1), None, "33.9 ms"),  # nothing to compare with
        (Gate("plan", 33.9, "ms", slack=0.1), 31.0, "ok"),
        (Gate("plan", 34.2, "ms", slack=0.1), 31.0, "worse"),
        (Gate("rate", 91.0, slack=0.1, more_is_better=True), 100.0, "ok"),
        (Gate("rate", 89.0, slack=0.1, more_is_better=True), 100.0, "worse"),
        (Gate("rate", 89.0, at_least=80.0, slack=0.1, more_is_better=True), 100.0, "ok"),
        (replace(SOLVED, value=0.61), 0.9, "ok"),
        (replace(SOLVED, value=0.59), 0.9, "worse"),
    ],
)
def test_a_figure_is_worse_only_beyond_its_baseline(capsys, gate, before, verdict):
    known = None if before is None else replace(gate, value=before)
    assert line(capsys, gate, known) == verdict
