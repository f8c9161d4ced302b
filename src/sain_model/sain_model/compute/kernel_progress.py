"""What is said while kernels are compiled, by whoever compiles them or waits for that."""

from typing import TYPE_CHECKING

from sain_core.cli.terminal import WaitingLine
from sain_model.compute.kernel_store import (
    compilation_progress,
    compile_kernels,
    kernels_are_ready,
)

if TYPE_CHECKING:
    from rich.console import Console


def describe_progress(finished: int, total: int) -> str:
    """Return in words how many kernels have been compiled."""
    return f"compiling {finished} of {total} kernels"


def describe_compilation() -> str:
    """Return in words what some process on this computer compiles; empty: none does."""
    progress = compilation_progress()
    return "" if progress is None else describe_progress(*progress)


def compile_visibly(console: "Console | None" = None) -> None:
    """Return when all kernels are compiled, at once where they are; show how far that is.

    By default on standard error.

    Raises:
        ModelUnavailableError: they cannot be compiled.
    """
    if kernels_are_ready():
        return
    if console is None:
        from rich.console import Console

        console = Console(stderr=True)
    with WaitingLine(console, 0.0) as line:
        compile_kernels(lambda finished, total: line.say(describe_progress(finished, total)))
