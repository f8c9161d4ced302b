"""The page of stable-worldmodel's Push-T counts what its environment stated within its budget."""

from benchmarks.pusht import ALL_DISK, NONE, PACKAGES, page
from sain_eval.loop.results import wilson_interval


def test_the_page_counts_successes_within_the_budget():
    made = {"commit": "abc", "processor": "some", **dict.fromkeys(PACKAGES, "1.0")}
    rows = [
        {"factor": name, "see": "states", "seed": seed, "success": success, "agreed": agreed}
        for name, successes in {ALL_DISK: (0, 40), NONE: (60, 101)}.items()
        for seed, (success, agreed) in enumerate(zip(successes, (0, 120), strict=True))
    ]
    lines = page({"episodes": [row | made for row in rows]}).splitlines()
    assert [line for line in lines if line.startswith(f"| {NONE}")] == [
        "| none | 1/2 | 9 to 91 % | 60 | 2/2 | 1/2 |"
    ]
    assert "## From pictures" not in lines
    assert [line.split(" |")[0] for line in lines if "/2" in line] == ["| none", f"| {ALL_DISK}"]


def test_the_interval_is_that_of_wilson():
    _, low, high = wilson_interval(48, 50)
    assert (round(low, 3), round(high, 3)) == (0.865, 0.989)
