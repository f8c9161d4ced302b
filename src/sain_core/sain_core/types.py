"""Array shapes used everywhere, named once.

B batch, N bodies, K sampled push sequences, H horizon (pushes in a sequence). A push is five
numbers, or eleven where it is a stroke (`sain_core.push`).
All arrays at public edges are ``float64``; the network converts inside. Where B is empty,
numpy gives scalars instead of arrays with no dimensions: they are just as good.
"""

from typing import TYPE_CHECKING

from jaxtyping import Bool, Float, Int
from numpy import bool_, float64, ndarray

if TYPE_CHECKING:
    from numpy import ndarray as BoolArray
    from numpy import ndarray as FloatArray
else:
    FloatArray, BoolArray = ndarray | float64, ndarray | bool_

Scene = Float[ndarray, "N 8"]
Scenes = Float[ndarray, "*B N 8"]
States = Float[ndarray, "*B 8"]
Polygons = Float[ndarray, "*B M 2"]
PushArray = Float[ndarray, "5"] | Float[ndarray, "11"]
Pushes = Float[ndarray, "*B 5"] | Float[ndarray, "*B 11"]
PushSequences = Float[ndarray, "K H 5"]
PredictedScenes = Float[ndarray, "K H N 8"]
Points = Float[ndarray, "*B 2"]
Place = Float[ndarray, "2"]  # x, y [m]
Angles = Float[FloatArray, "*B"]
Scalars = Float[FloatArray, "*B"]
Indices = Int[ndarray, "*B"]
Mask = Bool[BoolArray, "*B"]
