"""Bags to export, and their export."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numpy import ndarray

from sain_bags.dataset.conversion import convert
from sain_bags.dataset.formats import FormatName
from sain_bags.dataset.rows import ConversionConfig
from tests.sain_bags.driven import Drive, Parts

EPISODES = 5
Rows = dict[str, ndarray]


def drive(
    record: Callable[..., Any], name: str = "bag", parts: Parts = Parts(), seed: int = 0
) -> Path:
    """Record episodes of five pushes; the third of each is left out, being unsettled."""
    recording = record(name)
    driver = Drive(recording, parts, seed)
    for episode in range(1, EPISODES + 1):
        first = 10 * episode + (2**63 if episode == 2 else 0)  # ids are any of 64 bits
        driver.episode(episode, range(first, first + 5))
    recording.writer.close()
    return Path(recording.writer.folder)


def to(name: FormatName, bags: Path | list[Path], out: Path, **more: Any) -> Path:
    convert(bags if isinstance(bags, list) else [bags], out, ConversionConfig(format=name), **more)
    return out


def card_of(folder: Path) -> dict[str, Any]:
    card: dict[str, Any] = json.loads((folder / "card.json").read_text())
    return card
