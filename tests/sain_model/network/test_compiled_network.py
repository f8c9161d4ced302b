"""The compiled network: the same to the bit, whatever the batch, the threads and the process."""

import multiprocessing

import numba

from sain_core.model import Model
from sain_core.push import LENGTH
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.sain import PhysicsPrediction, ResidualNetwork, residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import draw_pushes, random_network

WEIGHTS = random_network(0.2).weights


def batch(count: int) -> tuple[Scenes, Pushes]:
    scenes, pushes = draw_pushes(count, 0)
    pushes[::7, LENGTH] = 0.0
    return scenes, pushes


def test_a_rollout_is_a_loop_to_the_bit_on_any_number_of_threads():
    sain = residual_model(WEIGHTS, friction_kind(PlanarPrior(), infers=False), "planar")
    scenes, pushes = batch(4 * 300)
    together = sain.step(scenes, pushes)
    for index in (0, 1, 127, 128, 299):
        alone = sain.step(scenes[index : index + 1], pushes[index : index + 1])
        assert alone[0].tobytes() == together[index].tobytes()
    sequences = pushes.reshape(300, 4, 5)
    stepwise = Model.rollout(sain, scenes[0], sequences)
    before = numba.get_num_threads()
    try:
        for threads in range(1, numba.config.NUMBA_NUM_THREADS + 1):
            numba.set_num_threads(threads)
            assert sain.rollout(scenes[0], sequences).tobytes() == stepwise.tobytes()
    finally:
        numba.set_num_threads(before)


def predict_in_child(queue: "multiprocessing.Queue[bytes]") -> None:
    physics = PhysicsPrediction(*batch(300), batch(300)[0])
    queue.put(ResidualNetwork(WEIGHTS).correct(physics).tobytes())


def test_a_forked_process_predicts_the_same():
    physics = PhysicsPrediction(*batch(300), batch(300)[0])
    here = ResidualNetwork(WEIGHTS).correct(physics).tobytes()
    queue = multiprocessing.get_context("fork").Queue()
    child = multiprocessing.get_context("fork").Process(target=predict_in_child, args=(queue,))
    child.start()
    there = queue.get(timeout=60)
    child.join(timeout=60)
    assert there == here
