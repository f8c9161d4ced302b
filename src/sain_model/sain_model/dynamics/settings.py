"""Names of models, importable without PyTorch."""

from typing import Final

PLANAR: Final = "planar"
PLANAR_AXES: Final = "planar_axes"
PLANAR_PRIORS: Final = (PLANAR, PLANAR_AXES)
SHIPPED: Final = "sain"
IDENTITY: Final = "identity"
STEPS: Final = (1, 5, 15)
