"""Recordings of before mean the same, with pushes of five numbers."""

from pathlib import Path

import numpy as np
import pytest

from sain_bags.dataset.conversion import ConversionConfig, convert
from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from tests.old_files.reading import FOLDER, KINDS, expected, five
from tests.sain_bags.dataset.conftest import read_npz


@pytest.mark.parametrize("kind", KINDS)
def test_rows_mean_the_same(kind: str, tmp_path: Path) -> None:
    convert([FOLDER / f"{kind}_bag"], tmp_path / "npz", ConversionConfig(keep_unsettled=True))
    rows, known = read_npz(tmp_path / "npz"), expected(f"{kind}_bag")
    wanted = {name.removeprefix("row_"): v for name, v in known.items() if name[:4] == "row_"}
    assert (rows["log_time"] >= wanted.pop("log_time")).all()  # of the result; then of the push
    wanted["action"] = five(wanted["action"], wanted.pop("body", None))
    assert rows.keys() - {"bag_sha256", "log_time"} == wanted.keys()
    for name, values in wanted.items():
        np.testing.assert_array_equal(rows[name], values, name)


@pytest.mark.parametrize("kind", KINDS)
def test_episodes_mean_the_same(kind: str) -> None:
    bag, known = Bag(FOLDER / f"{kind}_bag"), expected(f"{kind}_bag")
    for number, episode in enumerate(read_episodes(bag)):
        found = np.array([push.push for push in episode.pushes]).reshape(-1, 5)
        np.testing.assert_array_equal(found, five(known[f"episode{number}_pushes"]))
        for place, plan in enumerate(episode.plans):
            np.testing.assert_array_equal(plan.pushes, five(known[f"episode{number}_plan{place}"]))
    shown = [push for one in read_content(bag).data["episodes"] for push in one["pushes"]]
    assert {push["speed"] for push in shown} == {0.2}
