"""``sain print``: PDF sheets of tags and boards with true size."""

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_core.camera.decals import FAMILIES, tag_family
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.output import OVERWRITE_HELP, claim_file, write_whole
from sain_vision.printing import PAPERS, board_sheet, pdf_of, tag_sheets

MOST: Final = 200  # tags in a file
RANGE: Final = re.compile(r"([0-9]{1,99})(?:-([0-9]{1,99}))?")


@dataclass(frozen=True)
class PrintOptions(Config):
    """Write a PDF of tags for bodies, or of the board that calibrates a camera, with true size.

    Print it at 100 %, on matt paper, and measure the ruler at its foot.
    """

    out: Path = option(Path("results/tags.pdf"), "file to write")
    overwrite: bool = option(False, OVERWRITE_HELP)
    tags: str = option("0-9", "numbers of the tags: 3, 0-9 or 1,4,7-8")
    size: float = option(
        0.04, "side of a tag's black square", unit="m", minimum=0.005, maximum=0.25
    )
    family: str = option("36h11", "AprilTag family", choices=tuple(FAMILIES))
    paper: str = option("a4", "size of the sheets", choices=tuple(PAPERS))
    board: bool = option(False, "write the board instead")


def run(options: PrintOptions, console: Console) -> None:
    """Write the file.

    Raises `SainError`: numbers that cannot be, or a file that cannot be written.
    """
    claim_file(options.out, options.overwrite)
    if options.board:
        defaults = PrintOptions()
        for name in ("tags", "size", "family"):
            if getattr(options, name) != getattr(defaults, name):
                raise ConfigError(f"--board has its own tags; leave out --{name}")
        pages = [board_sheet(options.paper)]
    else:
        numbers = read_numbers(options.tags, len(tag_family(options.family)))
        pages = tag_sheets(options.family, numbers, options.size, options.paper)
    write_whole(options.out, pdf_of(pages))
    console.print(f"{options.out}: {len(pages)} pages; print at 100 %, then measure the ruler")


def read_numbers(text: str, count: int) -> list[int]:
    """Return the numbers that a text names, of a family of so many tags.

    Raises `ConfigError`: it names none, one twice, too many, or one that the family lacks.
    """
    numbers: list[int] = []
    for part in text.split(","):
        match = RANGE.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        if first > last:
            raise ConfigError(
                f"tags is {text!r}; allowed: numbers and upward ranges, as in 1,4,7-8"
            )
        if last >= count:
            raise ConfigError(f"tags is {text!r}; the family has the tags 0 to {count - 1}")
        numbers += range(first, last + 1)
    twice = [number for number, often in Counter(numbers).items() if often > 1]
    if twice:
        raise ConfigError(f"tags is {text!r}, which has tag {twice[0]} twice; give each once")
    if len(numbers) > MOST:
        raise ConfigError(f"tags is {text!r}, {len(numbers)} tags; allowed: 1 to {MOST}")
    return numbers
