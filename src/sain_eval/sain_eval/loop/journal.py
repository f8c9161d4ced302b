"""The file of an evaluation in which finished episodes are kept, so that it can be continued."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sain_core.errors import OutputError, UntrustedFileError
from sain_core.guarding.documents import parse_json
from sain_core.guarding.untrusted import read_regular_text
from sain_core.output import append_json, write_whole
from sain_eval.loop.results import JOURNAL_FILE, SceneRecord, record_of


class Journal:
    """A line for every finished episode, in a file; what is there from before is kept and read.

    The first line holds the settings. A last line cut off by a crash is dropped.
    """

    def __init__(
        self,
        folder: Path,
        settings: dict[str, Any],
        overwrite: bool = False,
        versions: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Open the journal in a folder. `add` makes or replaces it.

        With `overwrite`, one of other settings or versions of controllers, or a damaged one, is
        begun anew.
        Raises `OutputError`: it was kept with others, is damaged or cannot be written.
        """
        self.path, self._versions = folder / JOURNAL_FILE, versions
        self.records: list[SceneRecord] = []
        self._first: dict[str, Any] | None = None  # line that is written with the first episode
        try:
            self._read(json.loads(json.dumps(settings)), overwrite)  # with lists for tuples
        except OSError as error:
            raise OutputError(f"cannot use {self.path}: {error.strerror or error}") from error
        except UntrustedFileError as error:
            raise OutputError(f"{self.path} is not read: {error}") from error

    @property
    def done(self) -> set[tuple[str, int, str]]:
        """The episodes that are finished."""
        return {record.episode for record in self.records}

    def add(self, records: list[SceneRecord]) -> None:
        """Write one episode's records, one for each tolerance."""
        if self._first is not None:
            write_whole(self.path, (json.dumps(self._first) + "\n").encode())
            self._first = None
        records = [
            dataclasses.replace(one, version=self._versions.get(one.controller, ""))
            for one in records
        ]
        append_json(self.path, [dataclasses.asdict(record) for record in records])
        self.records += records

    def _read(self, settings: dict[str, Any], overwrite: bool) -> None:
        text = read_regular_text(self.path) if self.path.exists() else ""
        *lines, cut_off = text.split("\n")
        if not lines:
            self._begin(settings)
            return
        try:
            kept = parse_json(lines[0])["settings"]
            differing = [k for k in {*kept, *settings} if kept.get(k) != settings.get(k)]
            episodes = [parse_json(line) for line in lines[1:]]
            self.records = [record_of(item) for episode in episodes for item in episode]
            changed = {
                one.controller
                for one in self.records
                if one.version != self._versions.get(one.controller, one.version)
            }
            differing += [f"version of {name}" for name in changed]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if not overwrite:
                raise OutputError(
                    f"{self.path} is damaged ({error}); --overwrite begins anew, or choose another"
                    " --out"
                ) from error
            differing = ["line"]
        if differing and not overwrite:
            raise OutputError(
                f"{self.path} was made with another {', '.join(sorted(differing))};"
                " use the same, --overwrite, or choose another --out"
            )
        if differing:
            self._begin(settings)
        elif cut_off:
            write_whole(self.path, ("\n".join(lines) + "\n").encode())

    def _begin(self, settings: dict[str, Any]) -> None:
        self.records, self._first = [], {"settings": settings}
