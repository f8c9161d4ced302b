"""Damaged bags: rows are those of the whole bag, or one line says what is wrong."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.dataset.conversion import convert
from sain_bags.reading.reader import Bag
from sain_core.errors import DatasetError
from sain_core.randomness import generator
from tests.sain_bags.driven import Drive
from tests.sain_bags.independent import shards
from tests.sain_bags.writing.test_elsewhere import sqlite_bag, write_mcap, write_metadata

ROUNDS = 60
NO_CRCS = "it has no CRCs"


@pytest.fixture
def bags(record: Callable[..., Any], tmp_path: Path) -> dict[str, tuple[Path, Path]]:
    """Return two bags of four pushes for each storage: the second is of another recording."""
    made = []
    for seed in (0, 1):
        recording = record(f"ours{seed}")
        recording.now += seed * 3_600_000_000_000
        Drive(recording, seed=seed).episode(1, [1, 2, 3, 4])
        recording.writer.close()
        made.append(Path(recording.writer.folder))
    copies = [sqlite_bag(one, one.with_name(f"{one.name}_sqlite")) for one in made]
    others = [one.with_name(f"{one.name}_others") / "bag_0.mcap" for one in made]
    for bag, file in zip(map(Bag, made), others, strict=True):
        file.parent.mkdir()
        write_mcap(file, list(bag.raw_messages()), bag)
        write_metadata(file.parent, 9, [file.name])
    return {
        "mcap": (made[0], made[1]), "sqlite3": (copies[0], copies[1]),
        "mcap of others": (others[0].parent, others[1].parent),
    }  # fmt: skip


def mutated(file: Path, other: Path, random: np.random.Generator) -> str:
    """Damage a file in a random way, and return how."""
    whole, way = bytearray(file.read_bytes()), str(random.choice(["cut", "flip", "zeros", "swap"]))
    place = int(random.integers(len(whole)))
    if way == "cut":
        whole = whole[:place]
    elif way == "flip":
        whole[place] ^= 1 << int(random.integers(8))
    elif way == "zeros":
        size = len(whole[place : place + 512])
        whole[place : place + size] = bytes(size)
    elif way == "swap":
        whole = bytearray(other.read_bytes())
    file.write_bytes(whole)
    return way


@pytest.mark.parametrize("storage", ["mcap", "sqlite3", "mcap of others"])
def test_no_wrong_value_comes_without_a_word(
    storage: str, bags: dict[str, tuple[Path, Path]], tmp_path: Path
) -> None:
    (good, other), random, out = bags[storage], generator(7, 0), tmp_path / "rows"
    (file,), (stranger,) = Bag(good).files, Bag(other).files
    convert([good], out, overwrite=True)
    wanted, refused = shards(out), 0
    for number in range(ROUNDS):
        bag = tmp_path / good.name / "damaged"
        shutil.copytree(good, bag, ignore=shutil.ignore_patterns("damaged"))
        way = mutated(bag / file.name, stranger, random)
        try:
            notes = convert([bag], out, overwrite=True).notes
        except DatasetError as error:
            refused += 1
            assert str(bag) in str(error) and "\n" not in str(error), error
            continue
        finally:
            shutil.rmtree(bag)
        if storage == "sqlite3" and way in ("flip", "zeros"):  # nothing can detect those
            assert any(NO_CRCS in note for note in notes)
            continue
        if storage == "mcap of others" and way == "swap":  # its metadata state no counts or times
            continue
        found = shards(out)
        for key in wanted.keys() - {"bag_sha256"}:
            np.testing.assert_array_equal(found[key], wanted[key], f"{number} {way} {key}")
    assert refused > ROUNDS / 3
