"""The commands that read files of a kind."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final

from benchmarks.faults.hostile.goods import Goods
from sain_bringup.ros.closed_loop import ClosedLoopOptions
from sain_core.cli.command_line import Command, load
from sain_core.errors import SainError
from sain_model.serving.service import ServingConfig

Run = Callable[[], int | None]
SOON: Final = ("--wait", "0", "--rate", "1000", "--duration", "1")


def import_all(file: ModuleType) -> None:
    """Import what a command imports late: here, and not once more in each child."""
    for node in ast.walk(ast.parse(Path(file.__file__ or "").read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            import_module(node.module)


def commands(kind: str, path: Path, out: Path, goods: Goods) -> dict[str, Run]:
    """Return what reads a file of a kind, by name; `out` is a folder for what they write."""
    file = str(path)

    def run(name: str, *arguments: str) -> Run:
        package, _, command = name.partition(" ")
        entry: Command = load(f"{package} x", f"commands:{command}")
        import_all(entry.file)
        return lambda: entry([*arguments])

    if kind == "bag":
        return {
            "info": run("sain_bags info", file),
            "report": run("sain_bags report", file, "--out", str(out / "page.html")),
            "recover": run("sain_bags recover", file, "--out", str(out / "recovered")),
            "to_dataset": run("sain_bags to_dataset", file, "--out", str(out / "data")),
            "play": run("sain_bags play", file, *SOON),
        }
    evaluated = ("--open-loop", "1", "--out", str(out / "errors.json"))
    if kind in ("checkpoint", "belief"):
        data = str(goods.of("data").parent)
        load("sain_model x", "serving.server:load_server")
    if kind == "checkpoint":
        return {
            "load_model": lambda: load_model(file),
            "sain_model evaluate": run(
                "sain_model evaluate", data, "--checkpoint", file, *evaluated
            ),
        }
    if kind == "belief":
        return {
            "load_model": lambda: load_model("sain", file),
            "sain_model evaluate": run("sain_model evaluate", data, "--belief", file, *evaluated),
        }
    if kind == "data":
        belief = ("--out", str(out / "belief.json"), "--pushes", "8")
        training = ("--out", str(out / "model"), "--epochs", "1", "--hidden", "8", "--layers", "1")
        return {
            "identify": run("sain_model identify", file, *belief),
            "train": run("sain_model train", file, *training),
            "sain_model evaluate": run("sain_model evaluate", file, *evaluated),
        }
    if kind == "results":
        path.rename(out / "results.json")
        return {"results": run("sain_eval results", str(out), "--out", str(out / "page.md"))}
    return {"parameters": lambda: check_parameters(path)}


def load_model(name: str, belief: str = "") -> int:
    """Do what `model_node` does when it starts, and for `load_model`."""
    from sain_model.serving.server import load_server  # loads PyTorch

    try:
        load_server(ServingConfig(model=name, belief=belief))
    except SainError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


def check_parameters(path: Path) -> int:
    """Do what `closed_loop` does with a file of parameters."""
    try:
        ClosedLoopOptions(params_file=path)
    except SainError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0
