"""Pushes under many parameters in one batch, compiled: each row has physics of its own."""

from numba.np.unsafe.ndarray import to_fixed_tuple

from sain_model.compute.compiling import callable_kernel
from sain_model.physics.body_kernels import Physics, make_workspace
from sain_model.physics.push_kernels import CHUNK, push_bodies

NUMBERS = len(Physics._fields)


@callable_kernel
def push_varied_block(first, scenes, order, pushes, friction, table, physics, touched, corrections):
    """Carry out up to `CHUNK` pushes in place, as `push_bodies_block` does.

    `physics` (B, 20) has the numbers of a `Physics` for each push; `corrections` (B, 0, 7) are
    none.
    """
    work = make_workspace(table)
    for index in range(first, min(first + CHUNK, scenes.shape[0])):
        if pushes[index, 3] > 0.0:
            push_bodies(
                scenes[index],
                order[index],
                pushes[index],
                friction[index],
                table,
                Physics(*to_fixed_tuple(physics[index], NUMBERS)),  # type: ignore[call-arg]
                work,
                touched[index],
                corrections[index],
            )
