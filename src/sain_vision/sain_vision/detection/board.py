"""The board that a camera is calibrated with: tags whose numbers count up, on one sheet.

They are in rows, from the lower left one on; the origin is the lower left mark.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.shapes.body_file import Tag
from sain_core.types import Points

FAMILY: Final = "36h11"
FIRST: Final = 500  # number of the first tag
COLUMNS, ROWS = 5, 6
SIZE: Final = 0.028  # [m], side of a tag
GAP: Final = 0.008  # [m], between tags
STEP: Final = SIZE + GAP
EXTENT: Final = (COLUMNS * STEP, ROWS * STEP)  # [m], width and height from the origin


def board_corners() -> dict[int, Points]:
    """Return the corners (4, 2) [m] of each tag in the board's frame, by its number."""
    middle = GAP + SIZE / 2
    return {
        FIRST + row * COLUMNS + column: Tag(
            0, SIZE, middle + column * STEP, middle + row * STEP
        ).corners()
        for row in range(ROWS)
        for column in range(COLUMNS)
    }


def match_board(
    found: Mapping[int, Sequence[ndarray]],
) -> tuple[Float[ndarray, "P 2"], Float[ndarray, "P 2"]]:
    """Return corners (P, 2) [m] on the board and (P, 2) [px] in an image of tags found once."""
    own = board_corners()
    numbers = [number for number in own if len(found.get(number, ())) == 1]
    nothing = np.zeros((0, 2))
    return (
        np.concatenate([nothing, *(own[number] for number in numbers)]),
        np.concatenate([nothing, *(found[number][0] for number in numbers)]),
    )
