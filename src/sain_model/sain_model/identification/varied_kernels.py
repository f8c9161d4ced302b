"""Pushes under many parameters in one batch, compiled: each row has physics of its own."""

from numba.np.unsafe.ndarray import to_fixed_tuple

from sain_core.push import LENGTH
from sain_model.compute.compiling import callable_kernel
from sain_model.physics.body_kernels import Physics, make_workspace
from sain_model.physics.outline_kernels import make_outline_workspace
from sain_model.physics.outline_push_kernels import push_bodies
from sain_model.physics.planar_kernels import CHUNK, push_scene

NUMBERS = len(Physics._fields)


@callable_kernel
def push_varied_block(first, scenes, pushes, friction, start, physics, touched):
    """Carry out up to `CHUNK` pushes of disks in place, as `push_block` does.

    `physics` (B, 20) has the numbers of a `Physics` for each push.
    """
    work = make_workspace(scenes.shape[1])
    for index in range(first, min(first + CHUNK, scenes.shape[0])):
        if pushes[index, LENGTH] > 0.0:
            push_scene(
                scenes[index],
                pushes[index],
                friction[index],
                start[index],
                Physics(*to_fixed_tuple(physics[index], NUMBERS)),  # type: ignore[call-arg]
                work,
                touched[index],
            )


@callable_kernel
def push_varied_bodies_block(
    first, scenes, order, pushes, friction, table, physics, touched, corrections
):
    """Carry out up to `CHUNK` pushes of any bodies in place, as `push_bodies_block` does.

    `physics` (B, 20) has the numbers of a `Physics` for each push; `corrections` (B, 0, 7) are
    none.
    """
    work = make_outline_workspace(table)
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
