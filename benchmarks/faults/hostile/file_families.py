"""Families of hostile checkpoints, beliefs, data sets and documents, by name."""

import hashlib
import json
import shutil
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.faults.hostile.bags import Make, put_special
from benchmarks.faults.hostile.documents import LARGEST, Random, change_values, documents, mutate

MIB: Final = 1 << 20


def _write(text: str) -> Make:
    def write(_: Path, bad: Path, __: Random) -> None:
        bad.write_bytes(text.encode(errors="surrogateescape"))

    return write


def _special(kind: str) -> Make:
    return lambda _, bad, __: put_special(kind, bad)


def _mutate(good: Path, bad: Path, random: Random) -> None:
    bad.write_bytes(mutate(good.read_bytes(), random))


def _change(good: Path, bad: Path, random: Random) -> None:
    content = json.loads(good.read_text())
    change_values(content, random)
    bad.write_text(json.dumps(content))


FILES: Final[dict[str, Make]] = {
    "mutated": _mutate,
    **{f"file: {kind}": _special(kind) for kind in ("fifo", "zero", "folder", "loop", "memory")},
}
JSONS: Final[dict[str, Make]] = {
    **FILES,
    **documents(_write),
    "wrong kinds": _change,
    "long": lambda good, bad, _: bad.write_text("[" + "0," * 40_000_000 + "0]"),
}


def _card(good: Path, bad: Path, random: Random) -> None:
    shutil.copy(good, bad)
    _change(good.with_suffix(".json"), bad.with_suffix(".json"), random)


def _weights(change: Callable[[bytes, Random], bytes]) -> Make:
    """Return what changes weights, and makes the card agree with them."""

    def write(good: Path, bad: Path, random: Random) -> None:
        content = change(good.read_bytes(), random)
        card = json.loads(good.with_suffix(".json").read_text())
        card["weights_sha256"] = hashlib.sha256(content).hexdigest()
        bad.write_bytes(content)
        bad.with_suffix(".json").write_text(json.dumps(card))

    return write


def _beside(make: Make) -> Make:
    """Return what makes a hostile card for good weights."""

    def write(good: Path, bad: Path, random: Random) -> None:
        shutil.copy(good, bad)
        make(good.with_suffix(".json"), bad.with_suffix(".json"), random)

    return write


CHECKPOINTS: Final[dict[str, Make]] = {
    **FILES,
    **{f"card: {name}": _beside(make) for name, make in JSONS.items()},
    "weights: mutated": _weights(mutate),
    "weights: header": _weights(lambda content, _: LARGEST.to_bytes(8, "little") + content[8:]),
    "weights: large": _weights(lambda content, _: content + bytes(400 * MIB)),
}


def _arrays(change: Callable[[dict[str, Any]], object]) -> Make:
    def write(good: Path, bad: Path, _: Random) -> None:
        with np.load(good) as archive:
            arrays: dict[str, Any] = dict(archive)
        change(arrays)
        np.savez_compressed(bad, **arrays)

    return write


def _header(text: str, size: int = 64) -> Make:
    """Return what adds an array with this header, and zeros."""

    def write(good: Path, bad: Path, random: Random) -> None:
        shutil.copy(good, bad)
        piece = bytes(min(size, 16 * MIB))
        with (
            zipfile.ZipFile(bad, "a", zipfile.ZIP_DEFLATED) as archive,
            archive.open("state2.npy", "w", force_zip64=True) as member,
        ):
            member.write(b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode())
            for _ in range(size // len(piece)):
                member.write(piece)

    return write


def _shape(shape: str, kind: str = "<f8") -> str:
    return f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape},)}}\n"


DATA: Final[dict[str, Make]] = {
    **FILES,
    "1 GB": _header(_shape(f"{128 * MIB}"), 1024 * MIB),
    "false shape": _header(_shape("1000000000000")),
    "no size": _header(_shape("1000000000000", "<U0")),
    "deep header": _header("(" * 5000),
    "objects": _arrays(lambda a: a.update(state=np.array([{}], dtype=object))),
    "NaN": _arrays(lambda a: a.update(state=np.full_like(a["state"], np.nan))),
    "many bodies": _arrays(
        lambda a: a.update(
            {
                name: np.tile(a[name], 3000)
                for name in ("state", "next_state", "physics_next")
                if name in a
            }
        )
    ),
    "texts": _arrays(lambda a: a.update(episode=np.array(["x" * 1000] * len(a["episode"])))),
    "huge": _arrays(lambda a: a.update(state=np.full_like(a["state"], 1e300))),
    "no rows": _arrays(lambda a: a.update({name: value[:0] for name, value in a.items()})),
}
PARAMETERS: Final[dict[str, Make]] = {
    **JSONS,
    "wrong kinds": _write("mppi_node: {ros__parameters: [1]}"),
}
