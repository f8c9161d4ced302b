"""Good files, which hostile ones are made from."""

import contextlib
import os
from pathlib import Path
from typing import Final

from benchmarks.speed.made_bags import MadeBag
from sain_core.cli.command_line import load

SUFFIXES: Final = {
    "bag": "", "checkpoint": ".safetensors", "belief": ".json", "data": ".npz",
    "results": ".json", "parameters": ".yaml",
}  # fmt: skip


class Goods:
    """Good files, made when one is needed."""

    def __init__(self, folder: Path) -> None:
        """Make them in a folder."""
        self._folder = folder

    def of(self, kind: str) -> Path:
        """Return the good file of a kind."""
        path = self._folder / kind / {"results": "results.json"}.get(kind, f"good{SUFFIXES[kind]}")
        if not path.exists():
            path.parent.mkdir(exist_ok=True)
            getattr(self, f"_make_{kind}")(path)
        return path

    def _make_bag(self, path: Path) -> None:
        made = MadeBag(path)
        made.pushes(24)
        made.writer.close()

    def _make_data(self, path: Path) -> None:
        from sain_bags.dataset.conversion import convert

        convert([self.of("bag")], path.parent)
        next(path.parent.glob("shard-*.npz")).rename(path)

    def _make_checkpoint(self, path: Path) -> None:
        from sain_model.dynamics.load import shipped_checkpoint

        shipped = Path(str(shipped_checkpoint()))
        for suffix in (".safetensors", ".json"):
            path.with_suffix(suffix).write_bytes(shipped.with_suffix(suffix).read_bytes())

    def _make_belief(self, path: Path) -> None:
        _quietly("sain_model identify", str(self.of("data")), "--out", str(path), "--pushes", "8")

    def _make_results(self, path: Path) -> None:
        few = ("--scenes", "1", "--controllers", "null", "--pictures", "0")
        _quietly("sain_eval evaluate", "--out", str(path.parent), *few)

    def _make_parameters(self, path: Path) -> None:
        path.write_text('{"/sain/mppi_node": {"ros__parameters": {"planner": {"samples": 64}}}}')


def _quietly(name: str, *arguments: str) -> None:
    package, _, command = name.partition(" ")
    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        load(f"{package} x", f"commands:{command}")([*arguments])
