"""``python -m sain_eval.cli.shapes FILE``: draw all shapes into a PNG file."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_core.drawing.figures import write_png
from sain_core.errors import SainError
from sain_eval.plots.library_picture import draw_library

USAGE: Final = "usage: python -m sain_eval.cli.shapes FILE.png"


def main(arguments: Sequence[str]) -> int:
    """Write the picture and print its path; return the exit status."""
    console = Console(stderr=True, soft_wrap=True)
    if len(arguments) != 1 or arguments[0].startswith("-"):
        console.print(USAGE, markup=False, highlight=False)
        return 2
    try:
        path = write_png(draw_library(), Path(arguments[0]))
    except SainError as error:
        console.print(f"shapes: {error}", markup=False, highlight=False)
        return 1
    Console(soft_wrap=True).print(str(path), markup=False, highlight=False)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
