"""The journal of an evaluation: a line for every episode done, so that it can go on later."""

import dataclasses
import json
from pathlib import Path
from typing import Any, Final

from sain_core.errors import OutputError, UntrustedFileError
from sain_core.storage import append_json
from sain_core.untrusted import parse_json, read_regular_text
from sain_eval.loop.results import SceneRecord

JOURNAL_FILE: Final = "episodes.jsonl"

Key = tuple[str, int, str]  # scenario, seed, controller


class Journal:
    """Appends the records of finished episodes; what is there from before is kept and read.

    The first line holds the settings. A last line cut off by a crash is dropped.
    """

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        """Open the journal in a folder.

        Raises:
            OutputError: it was kept with other settings, is damaged or cannot be written.
        """
        self.path = folder / JOURNAL_FILE
        self.records: list[SceneRecord] = []
        self.done: set[Key] = set()
        settings = json.loads(json.dumps(settings))  # tuples become lists, as in the file
        try:
            self._read(settings)
        except OSError as error:
            raise OutputError(f"cannot use {self.path}: {error.strerror or error}") from error

    def _read(self, settings: dict[str, Any]) -> None:
        text = self._text()
        lines = text.split("\n")
        whole, cut_off = lines[:-1], lines[-1]
        if not whole:
            self.path.write_text(json.dumps({"settings": settings}) + "\n")
            return
        try:
            kept = parse_json(whole[0])["settings"]
            episodes = [[_record(item) for item in parse_json(line)] for line in whole[1:]]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise OutputError(
                f"{self.path} is damaged ({error}); remove it or choose another --out"
            ) from error
        if kept != settings:
            names = sorted(k for k in {*kept, *settings} if kept.get(k) != settings.get(k))
            raise OutputError(
                f"{self.path} was made with another {', '.join(names)};"
                " use the same, remove it or choose another --out"
            )
        if cut_off:
            self.path.write_text("\n".join(whole) + "\n")
        for episode in episodes:
            self._take(episode)

    def _text(self) -> str:
        try:
            return read_regular_text(self.path) if self.path.exists() else ""
        except UntrustedFileError as error:
            raise OutputError(f"{self.path} is not read: {error}") from error

    def add(self, records: list[SceneRecord]) -> None:
        """Write one episode's records, one for each tolerance."""
        append_json(self.path, [dataclasses.asdict(record) for record in records])
        self._take(records)

    def _take(self, records: list[SceneRecord]) -> None:
        self.records += records
        first = records[0]
        self.done.add((first.scenario, first.seed, first.controller))


def _record(item: dict[str, Any]) -> SceneRecord:
    for name in ("target_errors", "mid_errors", "turn_errors", "plan_seconds", "shapes"):
        if name in item:  # journals of earlier versions have the first two
            item[name] = tuple(item[name])
    return SceneRecord(**item)
