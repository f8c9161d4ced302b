"""A bag that every format is made from."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.dataset import conversion
from sain_bags.dataset.conversion import convert
from tests.sain_bags.dataset.formats.exported import Rows, drive
from tests.sain_bags.driven import Parts


@pytest.fixture
def bag(record: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bag whose episodes stand in more than one shard, and have gaps."""
    monkeypatch.setattr(conversion, "SHARD_SIZE", 7)
    return drive(record, parts=Parts(unsettled=(2,)))


@pytest.fixture
def rows(bag: Path, tmp_path: Path) -> Rows:
    """The rows of the bag as npz shards have them."""
    convert([bag], tmp_path / "npz")
    return read_npz(tmp_path / "npz")


def read_npz(folder: Path) -> Rows:
    shards = [dict(np.load(path)) for path in sorted(folder.glob("shard-*.npz"))]
    return {key: np.concatenate([shard[key] for shard in shards]) for key in shards[0]}
