"""Files of before pushes had five numbers, and what the reader of that time made of them."""

from pathlib import Path
from typing import Final

import numpy as np

from sain_core.push import make_push

FOLDER: Final = Path(__file__).parent
KINDS: Final = ("disks", "shapes")


def expected(name: str) -> dict[str, np.ndarray]:
    """Return what the reader of that time made of a file."""
    with np.load(FOLDER / f"{name}.expected.npz") as archive:
        return dict(archive)


def five(action: np.ndarray, body: np.ndarray | None = None) -> np.ndarray:
    """Return old pushes (P, 3) or (P, 4), the body last, as pushes (P, 5)."""
    if body is None:
        body = action[:, 3] if action.shape[1] > 3 else np.zeros(len(action))
    return make_push(*action[:, :3].T, body=body, speed=0.2)
