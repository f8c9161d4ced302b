"""What an evaluation plays: parts, each with its scenarios, controllers and tolerances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

from sain_eval.tolerance import Tolerance


@dataclass(frozen=True)
class TablePart:
    """Scenarios that are played by the same controllers to the same tolerances.

    Attributes:
        scenarios: their names.
        controllers: their names.
        tolerances: the widest first.
        most_scenes: of each scenario; None: as many as are asked for.
    """

    scenarios: tuple[str, ...]
    controllers: tuple[str, ...]
    tolerances: tuple[Tolerance, ...]
    most_scenes: int | None = None

    def scenes(self, asked: int) -> int:
        """Return how many scenes of each scenario are played where so many are asked for."""
        return asked if self.most_scenes is None else min(asked, self.most_scenes)

    def with_models(self, names: Sequence[str]) -> Self:
        """Return the part with more controllers, unless it is played on few scenes only."""
        if self.most_scenes is not None:
            return self
        return replace(self, controllers=tuple(dict.fromkeys([*self.controllers, *names])))


# The paper gives 5 cm. The tolerances of poses are those of docs/explanation/shapes.md.
PAPER_TOLERANCES: Final = tuple(map(Tolerance, (0.05, 0.02, 0.01, 0.005)))
POSE_TOLERANCES: Final = (Tolerance(0.02, 0.1), Tolerance(0.01, 0.05), Tolerance(0.005, 0.03))
STREAKS: Final = 3  # each takes up to 100 goals

TABLE_PARTS: Final = (
    TablePart(
        ("paper", "paper_shift", "paper_cube"),
        ("null", "straight", "random", "planar", "sain", "oracle"),
        PAPER_TOLERANCES,
    ),
    TablePart(
        ("anywhere", "anywhere_cube"), ("straight", "planar", "sain", "oracle"), PAPER_TOLERANCES
    ),
    TablePart(
        ("box", "push_t", "shapes", "shapes_indirect", "rearrange_2", "rearrange_3", "rearrange_4"),
        ("random", "planar", "sain", "oracle"),
        POSE_TOLERANCES,
    ),
    TablePart(("blocked",), ("straight", "planar", "sain", "oracle"), POSE_TOLERANCES),
    TablePart(("streak",), ("planar",), POSE_TOLERANCES, STREAKS),
)
TABLE_NOTE: Final = (
    "Scenarios of shapes are played without `null` and `straight`: these have no pushes for poses."
    " `straight` pushes a body 0 that is a disk only, as in `blocked`. `streak` takes longest: it"
    f" has at most {STREAKS} scenes, of `planar`."
)
