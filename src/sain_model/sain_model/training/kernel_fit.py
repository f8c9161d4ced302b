"""A kernel in place of the network, for few pushes of bodies that have names: ridge regression.

f_theta(x) = e(x) sum_i k(x, x_i) a_i over the pushes i that are learned from: k is Matern's kernel
(3/2), and e the error that physics makes at such a way. Far from all pushes physics remains as it
is. docs/decisions/0035-a-model-that-fits-itself.md has what else was tried.
"""

from dataclasses import replace
from typing import Final

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.randomness import generator
from sain_model.data.dataset import Dataset
from sain_model.inference.kinds import Kind
from sain_model.network.feature_kernels import MOVE_SCALE, WAY
from sain_model.network.features import count_features
from sain_model.network.network_kernels import ERROR_SHARE, LEAST_ERROR, MOST_ERROR
from sain_model.network.weights import CENTRES, OUTPUTS_OF, SCALES, TURN_ARM, NetworkWeights
from sain_model.training.objectives import examples_of, mixed_loss
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import LossHistory

FEW: Final = 2000  # pushes: of more, a network learns as well
FOLDS: Final = 5
RATIOS: Final = (0.1, 0.3, 1.0, 3.0, np.inf)  # of variances, of noise to what is learned
CERTAIN: Final = 1.0  # standard errors of a difference of losses
TAIL: Final = 4.0  # degrees of freedom of Student's t
PASSES: Final = 3  # of reweighting
OF_BODY: Final = {  # 1 / length of a body's columns: by evidence on 1,300 public pushes; the error
    # changes by at most 1 % where one of them is 0.7 or 1.4 times as large
    (7, 8, 10): 0.85,  # how physics moves it
    (11, 12, 13, 14): 0.9,  # the push
    (20, 21): 2.5,  # where on the table
    tuple(range(30, 41)): 0.55,  # what is believed of its physics
    (2, 5, 6, 15, 16, 17, 18, 19): 1.3,  # size, load and inertia
}
OF_TOOL: Final = (9, 10, 11, 15, 16, 17, 20, 21, 22, 24, 25, 28, 29, 30)  # gaps and contacts
OF_TOOL_SCALE: Final = 1.1

Matrix = Float[ndarray, "M K"]
Covariances = Float[ndarray, "M M"]


def fit_kernel(
    data: Dataset, kind: Kind, config: TrainingConfig
) -> tuple[NetworkWeights, LossHistory]:
    """Return a kernel on the pushes of a data set with beliefs, and its held-out loss over folds.

    The share of noise is the smallest one whose loss is not certainly larger than the lowest:
    physics was fitted to the held-out pushes too, so that all these losses are too large beside
    that of physics alone. If physics alone is certainly better, the kernel adds nothing.
    """
    examples = examples_of(data, kind, config)
    seen = torch.cat([examples.bodies[:, 0], examples.relations[:, 0]], dim=1).numpy()
    error = np.minimum(LEAST_ERROR + ERROR_SHARE * MOVE_SCALE * seen[:, WAY, None], MOST_ERROR)
    unit = error * np.array([1.0, 1.0, 1.0 / TURN_ARM])
    wanted = examples.residual[:, 0].numpy() / unit
    scales = _scales(config)
    near, rows = _kernel(scales * seen), torch.arange(len(seen))[:, None]

    def losses(predicted: Matrix) -> Float[ndarray, "M"]:
        told = torch.from_numpy((unit * predicted).astype(np.float32))[:, None, None]
        return mixed_loss(told, examples, rows, config).numpy()

    fold = folds(data.episode, config.seed)
    each = np.stack([losses(_crossed(near, wanted, fold, ratio)) for ratio in RATIOS])
    more = each - each[each.mean(axis=1).argmin()]
    chosen = int(np.argmax(more.mean(axis=1) <= CERTAIN * more.std(axis=1) / np.sqrt(len(seen))))
    outputs = _solve(near, wanted, RATIOS[chosen])
    history = LossHistory(
        [float(losses(near @ outputs).mean())], [float(each[chosen].mean())], float("inf")
    )
    if not outputs.any():
        history.start = history.validation[0]
    arrays = {CENTRES: seen, SCALES: scales, OUTPUTS_OF: outputs}
    tensors = {name: array.astype(np.float32) for name, array in arrays.items()}
    return NetworkWeights(replace(config.network, members=1), tensors), history


def _scales(config: TrainingConfig) -> Float[ndarray, "F"]:
    of_body, of_relation = count_features(config.network)
    scales = np.zeros(of_body + of_relation)
    for columns, scale in OF_BODY.items():
        scales[list(columns)] = scale
    scales[[of_body + column for column in OF_TOOL]] = OF_TOOL_SCALE
    return scales


def folds(episodes: ndarray, seed: int) -> ndarray:
    """Return the fold of each push (M,); those of an episode share one."""
    names, place = np.unique(episodes, return_inverse=True)
    return np.asarray((generator(seed, "folds").permutation(len(names)) % FOLDS)[place])


def _kernel(rows: Matrix) -> Covariances:
    squares = (rows**2).sum(axis=1)
    apart = np.maximum(squares[:, None] + squares - 2.0 * rows @ rows.T, 0.0)
    root = np.sqrt(3.0 * apart)
    return np.asarray((1.0 + root) * np.exp(-root))


def _solve(near: Covariances, wanted: Matrix, ratio: float) -> Matrix:
    """Return the outputs of centres: of ridge regression with Student's t, by reweighting."""
    outputs, weight = np.zeros_like(wanted), np.ones(len(wanted))
    if np.isinf(ratio):
        return outputs
    for _ in range(PASSES):
        outputs = np.linalg.solve(near + np.diag(ratio / weight), wanted)
        squares = ((wanted - near @ outputs) ** 2).sum(axis=1)
        variance = max(float((weight * squares).mean()) / 3.0, 1e-12)
        weight = (TAIL + 3.0) / (TAIL + squares / variance)
    return outputs


def _crossed(near: Covariances, wanted: Matrix, fold: ndarray, ratio: float) -> Matrix:
    """Return predictions of each fold by a kernel on the others."""
    predicted = np.zeros_like(wanted)
    for number in np.unique(fold):
        held = fold == number
        outputs = _solve(near[np.ix_(~held, ~held)], wanted[~held], ratio)
        predicted[held] = near[np.ix_(held, ~held)] @ outputs
    return predicted
