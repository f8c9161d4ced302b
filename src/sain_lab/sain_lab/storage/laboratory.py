"""A laboratory: a folder with what was learned where a table stands.

    laboratory.json    format, name, how long the log is at least, the model in service
    pushes.log         every push that was learned from, and every decision (`sain_lab.storage.log`)
    belief.json        what is believed of the physics, as ``sain_model identify`` writes it
    models/000100/     a network trained on the first 100 pushes, with its card
    waiting.log        pushes that were received, until they are in the log
    outlines.json      of bodies that are no shapes of the library, as a data set has them

The log is the truth: all else can be made from it again, or is a file that is whole or absent. So a
kill at any moment leaves the laboratory whole. One process may write it at a time. What SAIN did
not write in the folder stays as it is (`sain_core.output`).
"""

import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from threading import Lock
from typing import Any, Final, Self

import numpy as np

from sain_core.config import typed
from sain_core.errors import BusyError, ConfigError, DatasetError, OutputError, SainError
from sain_core.guarding.documents import read_json
from sain_core.guarding.locks import LockedError, lock_file
from sain_core.guarding.untrusted import is_file
from sain_core.output import (
    claim_folder,
    is_ours,
    make_folder,
    remove,
    sign,
    write_json,
)
from sain_core.provenance import FORMAT, other_format
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import register_outlines
from sain_core.shapes.outlines import OUTLINES_FILE, stored_outlines, write_outlines
from sain_core.shapes.shape import FEET
from sain_lab.storage import log
from sain_lab.storage.log import Event, LogReader, LogWriter, Record
from sain_lab.storage.results import Result
from sain_model.physics.parameters import BY_NAME

PREFIX: Final = "lab:"
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
MANIFEST, LOG, BELIEF = "laboratory.json", "pushes.log", "belief.json"
MODELS, WAITING, LOCK = "models", "waiting.log", ".lock"
PHYSICS: Final = "physics"  # in service in place of a network: as it is believed
PLANAR: Final = "planar"  # likewise: with values of no laboratory
SHIPPED: Final = "shipped"  # likewise: the model that comes with SAIN
NETWORK: Final = re.compile(rf"{MODELS}/\d+")  # the folder of a network


def data_folder() -> Path:
    """Return where laboratories are kept by name: ``$XDG_DATA_HOME/sain/laboratories``."""
    home = os.environ.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(home) / "sain" / "laboratories"


def laboratory_path(name: str) -> Path:
    """Return the folder of a laboratory: a name, ``lab:NAME``, or a path.

    Raises `ConfigError`: neither.
    """
    name = name.removeprefix(PREFIX)
    if "/" in name or name.startswith(("~", ".")):
        return Path(name).expanduser()
    if not NAME.fullmatch(name):
        raise ConfigError(
            f"laboratory {name!r} is no name: allowed are letters, digits, '_', '-' and '.', up to"
            " 64; or a path with a '/'"
        )
    return data_folder() / name


def laboratory_names() -> list[str]:
    """Return the names of the laboratories of this user."""
    folder = data_folder()
    return sorted(path.parent.name for path in folder.glob(f"*/{MANIFEST}"))


def service_of(pushes: int) -> str:
    """Return the folder of a network, below the laboratory, by what it was trained on."""
    return f"{MODELS}/{pushes:06d}"


@dataclass(frozen=True)
class Manifest:
    """What a laboratory states of itself."""

    name: str  # of it
    made: float  # seconds since 1970
    log_bytes: int = 0  # its log is at least as long
    # `PHYSICS`, `PLANAR`, `SHIPPED`, or the folder of the network in service, below the laboratory
    service: str = PHYSICS
    generation: int = 0  # how often what is in service has changed

    def __post_init__(self) -> None:
        for item in fields(self):
            typed(item.name, item.type, getattr(self, item.name))
        if self.has_network and not NETWORK.fullmatch(self.service):
            raise ConfigError(f"service is {self.service!r}")

    @property
    def has_network(self) -> bool:
        """Whether a network of this laboratory is in service."""
        return self.service not in (PHYSICS, PLANAR, SHIPPED)


class Laboratory:
    """A laboratory on the disk, to look at; `open` it to write."""

    def __init__(self, path: Path) -> None:
        """Read the manifest.

        Raises:
            DatasetError: no laboratory is there, one of another version, or one copied in part.
        """
        self.path, self.name, self.log_path = path, path.name, path / LOG
        self.belief_path = path / BELIEF  # which need not exist yet
        self.manifest = _read_manifest(path)
        self.damage: list[str] = []  # a sentence for each damaged line that was read
        self._check_whole()

    @classmethod
    def named(cls, name: str) -> Self:
        """Return the laboratory of a name or path."""
        return cls(laboratory_path(name))

    @property
    def bytes(self) -> int:
        """The size of all its files."""
        return sum(path.stat().st_size for path in self.path.rglob("*") if path.is_file())

    def records(self) -> Iterator[Record]:
        """Yield the records of the log; raises `DatasetError`. `damage` says what is missing."""
        yield from self._read(self.log_path, check_record)

    def waiting(self) -> Iterator[Result]:
        """Yield results that were received, and may not be in the log yet; as `records`."""
        if (self.path / WAITING).exists():
            found = self._read(self.path / WAITING, Result.of_record)
            yield from map(Result.of_record, found)

    def _read(self, path: Path, check: Callable[[Record], object]) -> Iterator[Record]:
        register_outlines(self.path)
        reader = LogReader(path, check)
        yield from reader.read()
        self.damage += [text for text in reader.damage if text not in self.damage]

    def model_path(self, service: str) -> Path:
        """Return the checkpoint in a folder of a network."""
        return self.path / service / "sain.safetensors"

    def _check_whole(self) -> None:
        log, manifest = self.log_path, self.manifest
        size = log.stat().st_size if log.exists() else 0
        if size < manifest.log_bytes:
            raise DatasetError(
                f"laboratory {self.path} is not whole: its log has {size:,} bytes, and"
                f" {MANIFEST} states {manifest.log_bytes:,}; copy it again while nothing learns"
            )
        if manifest.has_network and not self.model_path(manifest.service).exists():
            raise DatasetError(
                f"laboratory {self.path} is not whole: the model in service,"
                f" {self.model_path(manifest.service)}, is missing; copy it again"
            )


class OpenLaboratory(Laboratory):
    """A laboratory that this process alone may write."""

    def __init__(self, path: Path, owner: str = "learner") -> None:
        """Lock the laboratory; make it where there is none.

        Raises `BusyError`: another process has it; naming that; `OutputError`: it cannot be
        written; `DatasetError`: as `Laboratory`.
        """
        if not (path / MANIFEST).exists():
            claim_folder(path)
        make_folder(path)
        self._lock = _lock(path, owner)
        try:
            if not (path / MANIFEST).exists():
                _write_manifest(path, Manifest(path.name, time.time()))
            super().__init__(path)
            self._log = LogWriter(self.log_path)
            self._waiting = LogWriter(path / WAITING, durable=False)
            self._outlined, self._outlines = set[Bodies](), Lock()  # whose outlines are kept
            _sign(path)
        except BaseException as error:
            os.close(self._lock)
            if isinstance(error, OSError) and not isinstance(error, SainError):
                raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
            raise

    def append(self, record: Record) -> None:
        """Append a record to the log; raises `OutputError`."""
        self._log.append(record)

    def keep_outlines(self, bodies: Bodies) -> None:
        """Write outlines that are not the library's, before the log names them; on any thread.

        Raises `OutputError`.
        """
        with self._outlines:
            if bodies in self._outlined:
                return
            kept = {shape.name: shape for shape in stored_outlines(self.path)}
            traced = [shape for shape in bodies.shapes if getattr(shape, "is_traced", False)]
            new = [one for shape in traced if (one := shape.on(FEET)).name not in kept]
            if new:
                write_outlines(self.path, [*kept.values(), *new])
            self._outlined.add(bodies)

    def state(self, **changes: Any) -> None:
        """Write the manifest with changes, and how long the log is now."""
        content = vars(self.manifest) | {"log_bytes": self._log.size} | changes
        manifest = Manifest(**content)
        if manifest != self.manifest:
            _write_manifest(self.path, manifest)
            self.manifest = manifest

    def receive(self, record: Record) -> None:
        """Keep a push until `learned_all`, over a kill too; raises `OutputError`."""
        self._waiting.append(record)

    def learned_all(self) -> None:
        """Remove what was received: it is in the log. A file with damage stays."""
        if not any(str(self.path / WAITING) in text for text in self.damage):
            self._waiting.clear()

    def check_network(self, service: str) -> None:
        """Check that a network can be written to this folder; raises `OutputError`."""
        for path in (self.path / MODELS, self.path / service):
            if path.is_symlink():
                raise OutputError(f"{path} is a symbolic link; a network is written to a folder")
        if (self.path / service).exists():
            raise OutputError(f"{self.path / service} exists, and is of no training; move it away")

    def close(self) -> None:
        """Write the manifest, and let another process have the laboratory."""
        self.state()
        self._log.close()
        self._waiting.close()
        os.close(self._lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def forget(name: str) -> Path:
    """Remove a laboratory; return where it was.

    Raises `DatasetError`: there is none; `BusyError`: a learner has it; `OutputError`: something in
    it is not ours, or a link leads there: nothing is removed.
    """
    path = laboratory_path(name)
    _read_manifest(path)
    lock = _lock(path, "forget") if (path / LOCK).exists() else None
    try:
        remove(path)
    finally:
        if lock is not None:
            os.close(lock)
    return path


def _lock(path: Path, owner: str) -> int:
    try:
        return lock_file(path / LOCK, owner)
    except LockedError as error:
        raise BusyError(
            f"laboratory {path} is open already: process {error.holder or 'without a name'} learns"
            " there; stop it, or take another laboratory"
        ) from None


def _sign(path: Path) -> None:
    """Name the files of a laboratory that was opened as ours: they are written again and again."""
    for name in (MANIFEST, LOG, WAITING, LOCK):
        sign(path / name, grows=True)
    if is_file(changed := path / BELIEF) and not is_ours(changed):
        raise OutputError(
            f"{changed} was changed since SAIN wrote it, and would be replaced; move it away"
        )
    claim_folder(path, (MANIFEST, BELIEF, OUTLINES_FILE))


def _is_count(value: Any) -> bool:
    return type(value) is int and value >= 0


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _are_numbers(value: Any) -> bool:
    return all(map(_is_number, value.values()))


ALLOWED: Final[dict[str, Callable[[Any], object]]] = {  # of records and events, by name
    "pushes": _is_count,
    **dict.fromkeys(("errors", "was"), _are_numbers),
    **dict.fromkeys(("id", "episode"), lambda text: isinstance(text, str)),
    "time": _is_number,
    "service": lambda name: name in (PHYSICS, PLANAR, SHIPPED) or NETWORK.fullmatch(name),
    "model": NETWORK.fullmatch,
    "unseen": lambda errors: all(error is None or _is_number(error) for error in errors),
    "parameters": lambda found: all(
        _is_number(value) and _is_number(spread) and BY_NAME[name]
        for name, (value, spread) in found.items()
    ),
}
RECORDS: Final = ("push", "belief", "event", "end")
NEEDED: Final = {  # by kinds of records and of events
    "push": ("errors",), "belief": ("pushes", "parameters"),
    log.LOADED: ("service",), log.DROPPED: ("service",), log.TRAINED: ("model", "unseen"),
    log.TRAINING: ("model",), log.LEFT_OUT: ("model",), log.NOT_LEARNED: ("id",),
}  # fmt: skip


def check_record(record: Record) -> None:
    """Check that a record of a log has what its kind needs.

    Raises `SainError`, `LookupError`, `TypeError` or `ValueError`: it has not.
    """
    kind = record["kind"]
    about: Mapping[str, Any] = record
    if kind not in RECORDS:
        raise ValueError(f"its kind {kind!r} is not of this version")
    if kind == "push":
        Result.of_record(record)
    elif kind == "event":
        event = Event.of_record(record)
        kind, about = event.kind, event.about
        if not isinstance(about, dict):
            raise TypeError(f"about is {about!r}")
        if "after" in about and np.array(about["after"], np.float64).shape[1:] != (STATE_SIZE,):
            raise ValueError("after is no scene")
    content = {**record, **about, **{name: about[name] for name in NEEDED.get(kind, ())}}
    for name in ALLOWED.keys() & content.keys():
        if not ALLOWED[name](content[name]):
            raise ValueError(f"{name} is {content[name]!r}")


def _write_manifest(path: Path, manifest: Manifest) -> None:
    write_json(path / MANIFEST, {"format": FORMAT, **vars(manifest)})


def _read_manifest(path: Path) -> Manifest:
    try:
        content = read_json(path / MANIFEST)
        found = content.pop("format")
        manifest = Manifest(**content) if found == FORMAT else None
    except FileNotFoundError:
        known = ", ".join(laboratory_names()) or "none"
        raise DatasetError(
            f"there is no laboratory at {path}; there are: {known}; `graph --learn` makes one"
        ) from None
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else error
        raise DatasetError(f"{path / MANIFEST} is damaged: {reason}; copy it again") from error
    if manifest is None:
        wrong = other_format(found, "begin another laboratory")
        raise DatasetError(f"laboratory {path} {wrong}")
    return manifest
