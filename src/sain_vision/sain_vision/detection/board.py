"""The board that a camera is calibrated with: tags at known places on one sheet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.camera.decals import tag_family
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.shapes.body_file import Tag
from sain_core.types import Points


@dataclass(frozen=True)
class Board(Config):
    """Rows of tags whose numbers count up, from the lower left one on."""

    family: str = option("36h11", "AprilTag family of the tags", choices=("36h11",))
    first: int = option(500, "number of the first tag", minimum=0)
    columns: int = option(5, "tags in a row", minimum=2, maximum=20)
    rows: int = option(6, "rows", minimum=2, maximum=20)
    size: float = option(0.028, "side of a tag", unit="m", minimum=0.005, maximum=0.2)
    gap: float = option(0.008, "between tags", unit="m", minimum=0.002, maximum=0.1)

    def __post_init__(self) -> None:
        """Check the fields, and that the family has the tags."""
        super().__post_init__()
        last, most = self.first + self.columns * self.rows - 1, len(tag_family(self.family)) - 1
        if last > most:
            raise ConfigError(
                f"the board has the tags {self.first} to {last}; {self.family} has 0 to {most}:"
                " give a smaller first"
            )

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height [m] from the origin."""
        step = self.size + self.gap
        return self.columns * step, self.rows * step

    def corners(self) -> dict[int, Points]:
        """Return the corners (4, 2) [m] of each tag in the board's frame, by its number."""
        step = self.size + self.gap
        middle = self.gap + self.size / 2
        return {
            self.first + row * self.columns + column: Tag(
                0, self.size, middle + column * step, middle + row * step
            ).corners()
            for row in range(self.rows)
            for column in range(self.columns)
        }

    def common(
        self, found: Mapping[int, Sequence[ndarray]]
    ) -> tuple[Float[ndarray, "P 2"], Float[ndarray, "P 2"]]:
        """Return corners (P, 2) [m] on the board and (P, 2) [px] in an image of tags found once."""
        own = self.corners()
        numbers = [number for number in own if len(found.get(number, ())) == 1]
        if not numbers:
            return np.zeros((0, 2)), np.zeros((0, 2))
        return (
            np.concatenate([own[number] for number in numbers]),
            np.concatenate([found[number][0] for number in numbers]),
        )
