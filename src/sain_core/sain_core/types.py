"""Array shapes used everywhere, named once.

B batch, N disks, K sampled push sequences, H horizon (pushes in a sequence).
All arrays at public edges are ``float64``; the network converts inside. Where B is empty,
numpy gives scalars instead of arrays with no dimensions: they are just as good.
"""

from typing import TYPE_CHECKING

from jaxtyping import Bool, Float
from numpy import bool_, float64, ndarray

if TYPE_CHECKING:
    from numpy import ndarray as BoolArray
    from numpy import ndarray as FloatArray
else:
    FloatArray, BoolArray = ndarray | float64, ndarray | bool_

Scene = Float[ndarray, "N 8"]
Scenes = Float[ndarray, "*B N 8"]
PushArray = Float[ndarray, "3"]
Pushes = Float[ndarray, "*B 3"]
PushSequences = Float[ndarray, "K H 3"]
PredictedScenes = Float[ndarray, "K H N 8"]
Points = Float[ndarray, "*B 2"]
Angles = Float[FloatArray, "*B"]
Scalars = Float[FloatArray, "*B"]
Mask = Bool[BoolArray, "*B"]
