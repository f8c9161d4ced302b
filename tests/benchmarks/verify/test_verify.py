"""`sain verify`: figures are read from pages, and judged beside new samples of them."""

import json
import shutil
import subprocess

import pytest

from benchmarks.faults.running import PARTS
from benchmarks.verify.judging import Measured, judge
from benchmarks.verify.pages import (
    ROOT,
    Claim,
    all_pages,
    bounded_claims,
    share_claims,
    solved_claims,
    stated_elsewhere,
    without_command,
)
from benchmarks.verify.samples import (
    ANYTHING,
    BODIES,
    FAULTS,
    MODEL,
    PUSHT,
    REAL,
    RESULTS,
    WORLDS,
)
from sain_core.errors import ConfigError
from sain_eval.cli import verify

PAGE = """# Errors

| model | error |
| --- | ---: |
| planar | 2.72 [2.65, 2.79] |

## Loops

**57/100** scenes, 9.9 mm. The command is `make table`.

## `anywhere`

| within | model | Bullet |
| --- | --- | ---: |
| 0.5 cm | planar prior, history | **57/100** (47-66 %), 10.0 pushes, 12.9 s, 9.9 mm |
"""

COUNTS = """
| body | reached | mean [s] | C3+ |
| --- | ---: | ---: | ---: |
| push t | 19/20 | 7.2 | 26.9 |

| Fault | Tries | Survived | Lost |
| --- | ---: | ---: | ---: |
| SIGKILL: model | 50 | 49 | 1 |
| SIGKILL: model | 20 | 20 | 0 |
"""


def test_claims_are_what_the_page_states(tmp_path):
    (tmp_path / "page.md").write_text(PAGE)
    (claims,) = solved_claims("page.md", tmp_path).values()
    assert [(one.what, one.value, one.n) for one in claims] == [
        ("solved", 0.57, 100), ("pushes", 10.0, 57), ("s", 12.9, 100), ("mm", 9.9, 100),
    ]  # fmt: skip
    claim = bounded_claims("page.md", "Errors", "error", tmp_path)["planar"]
    assert (claim.value, claim.bounds, claim.digit) == (2.72, (2.65, 2.79), 0.005)

    (tmp_path / "page.md").write_text(COUNTS)
    claims = share_claims("page.md", tmp_path)
    shares = {
        row[1]: [(one.what, one.value, one.n) for one in found] for row, found in claims.items()
    }
    assert shares == {
        "push t": [("solved", 0.95, 20), ("s", 7.2, 19)], "SIGKILL: model": [("solved", 0.98, 50)],
    }  # fmt: skip


def test_figures_without_a_command_or_another_than_on_the_page_they_repeat(tmp_path):
    (tmp_path / "page.md").write_text(PAGE)
    assert [*without_command("page.md", tmp_path)] == [
        "page.md, Errors: 1 figures, the first is 2.72 [2.65, 2.79]",
        "page.md, `anywhere`: 1 figures, the first is"
        " **57/100** (47-66 %), 10.0 pushes, 12.9 s, 9.9 mm",
    ]
    (tmp_path / "face.md").write_text(
        "| a | b |\n| --- | --- |\n| x | 57/100, 10.0 |\n| y | 2.71 mm |\n"
    )
    (line,) = stated_elsewhere("face.md", ("page.md",), tmp_path)
    assert line.startswith("face.md, , y: 2.71 mm is in none of page.md")


@pytest.mark.parametrize(
    ("claim", "new", "inside"),
    [
        (("solved", 0.99, 100, None), Measured(0.95, 40, 0.84, 0.99), True),
        (("solved", 0.99, 100, None), Measured(0.5, 40, 0.35, 0.65), False),
        (("mm", 2.7, 0, (2.6, 2.8)), Measured(2.9, 300, 2.6, 3.2), True),
        (("mm", 2.7, 0, (2.6, 2.8)), Measured(3.5, 300, 3.2, 3.8), False),
        (("pushes", 4.1, 300, None), Measured(3.0, 2, 3.0, 3.0), True),  # too few to judge
    ],
)
def test_a_figure_is_outside_only_where_both_are_no_chance(claim, new, inside):
    what, value, n, bounds = claim
    stated = Claim("page.md", "a, b", what, value, n, bounds)
    (judged,) = judge([(stated, new)])
    assert judged.inside == inside


def test_few_values_that_lie_close_to_each_other_are_judged_by_the_usual_spread():
    usual = [
        (Claim("page.md", f"{n}", "s", 5.0, 100, None), Measured(5.0, 4, 3.5, 6.5))
        for n in range(9)
    ]
    close = (Claim("page.md", "a", "s", 5.1, 100, None), Measured(7.8, 4, 7.7, 7.9))
    assert not judge([close])[0].inside
    assert all(one.inside for one in judge([*usual, close]))
    many = (Claim("page.md", "a", "s", 5.1, 100, None), Measured(7.8, 40, 7.7, 7.9))
    assert not judge([*usual, many])[-1].inside


def test_many_figures_are_not_outside_by_chance():
    """One of a hundred at 2 % is expected; alone it would be outside."""
    near = (Claim("page.md", "a, b", "mm", 2.0, 0, (1.9, 2.1)), Measured(2.24, 300, 2.04, 2.44))
    assert not judge([near])[0].inside
    assert all(one.inside for one in judge(100 * [near]))


def test_every_figure_that_is_sampled_is_on_its_page():
    assert sum(map(len, solved_claims(RESULTS).values())) > 300
    assert len(bounded_claims(REAL, "5 folds", "position [mm]")) == 11
    assert {("Faults", f"SIGKILL: {name}") for name in PARTS} <= share_claims(FAULTS).keys()
    assert ("From pictures", "block.shape") in share_claims(PUSHT)
    named = {("ur5, seen by tags", name.replace("_", " ")) for name in BODIES}
    assert named <= share_claims(ANYTHING).keys()
    assert set(bounded_claims(MODEL, "Accuracy", "ratio of positions")) == set(WORLDS)


def test_every_figure_has_a_command_beside_it():
    assert [line for page in all_pages() for line in without_command(page)] == []


def test_an_installed_package_says_that_it_needs_a_checkout(tmp_path, monkeypatch, capsys):
    shutil.copytree(ROOT / "src/sain_eval/sain_eval/cli", tmp_path / "a/b/c/d/cli")
    monkeypatch.setattr(verify, "__file__", str(tmp_path / "a/b/c/d/cli/verify.py"))
    with pytest.raises(ConfigError, match=r"needs a checkout: .* clone the repository"):
        verify.run(verify.VerifyOptions(out=tmp_path / "out"), None)


@pytest.mark.system
@pytest.mark.timeout(900)
def test_a_tenth_of_the_figures_is_measured_again(tmp_path):
    command = [
        "sain",
        "verify",
        "--share",
        "0.1",
        "--only",
        "loops",
        "--out",
        str(tmp_path / "out"),
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    found = json.loads((tmp_path / "out" / "verify.json").read_text())
    outside = [one["row"] for one in found["figures"] if not one["inside"]]
    assert (done.returncode, outside) == (0, []), done.stdout + done.stderr
    assert len(found["figures"]) > 250 and found["pages"].keys() == {*all_pages()}
