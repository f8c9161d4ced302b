"""How the commands of this package begin and end."""

from collections.abc import Callable

from rich.console import Console
from rich.markup import escape

from sain_core.errors import SainError


def carry_out(work: Callable[[Console], object], unit: str = "") -> int:
    """Do the work of a command and return its exit code: 1 after an error, 130 after Ctrl-C.

    Args:
        work: what it does, with a console to say it on.
        unit: what it goes on from when the same command is given again; empty: nothing, and
            Ctrl-C is not caught.
    """
    console = Console()
    try:
        work(console)
    except SainError as error:
        Console(stderr=True).print(f"[red]error:[/] {escape(str(error))}", highlight=False)
        return 1
    except KeyboardInterrupt:
        if not unit:
            raise
        console.print(f"stopped; the same command goes on from the last whole {unit}")
        return 130
    return 0
