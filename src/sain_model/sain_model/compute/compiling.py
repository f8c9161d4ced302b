"""How kernels are compiled, and where they are kept: one folder for each version of the sources.

Numba checks only the file of a cached function, not the files of the functions it calls. After
an edit in one kernel module the others would run the old code, so the folder's name carries a hash
of all kernels and of the modules that they take constants from.
"""

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numba
import numpy as np
from numba.extending import overload, register_jitable

import sain_core
from sain_core.workers.scratch import cache_folder

PACKAGE: Final = Path(__file__).parents[1]
CORE: Final = Path(sain_core.__path__[0])
CORE_CONSTANTS: Final = ("scene.py", "push.py")
CONSTANTS: Final = ("compute/compiling.py",)
OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy", "fastmath": {"contract", "arcp"}}


def keep_kernels_apart() -> None:
    """Send Numba's cache to the folder of these sources, unless NUMBA_CACHE_DIR says where."""
    numba.config.CACHE_DIR = str(kernel_folder())  # type: ignore[attr-defined]


@functools.cache
def kernel_folder() -> Path:
    """Return where compiled kernels of these sources are kept."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given) if given else cache_folder() / f"kernels-{sources_hash()}"


def plain(array: np.ndarray) -> np.ndarray:
    """Return an array as kernels are compiled for it; copied only where it is of another kind.

    A read-only array or one with gaps would make Numba compile its kernel once more, for seconds.
    """
    return np.require(array, np.float64, ["C_CONTIGUOUS", "ALIGNED", "WRITEABLE"])


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel: cached, division by zero gives infinity, a * b + c may be fused."""
    return _compile(function)


def compiled_apart(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that is called and not copied to where it is used: it compiles once."""
    return _compile(function, inline=False)


def shared(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels compile a function that stays plain Python: NumPy calls it with whole arrays."""
    options: Any = {**OPTIONS, "forceinline": True}
    plain_function: Callable[..., Any] = register_jitable(**options)(function)
    return plain_function


def chosen_by_type(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let what is decorated choose, by the types of its arguments, how kernels run a function."""
    options: Any = {**OPTIONS, "forceinline": True}
    chooser: Callable[..., Any] = overload(function, jit_options=options)
    return chooser


def _compile(function: Callable[..., Any], inline: bool = True) -> Callable[..., Any]:
    keep_kernels_apart()
    compiled_function: Callable[..., Any] = numba.njit(
        cache=True,
        nogil=True,  # `sain_model.compute.thread_pool` runs kernels side by side
        forceinline=inline,
        **OPTIONS,
    )(function)
    return compiled_function


def sources_hash(package: Path = PACKAGE, core: Path = CORE) -> str:
    """Return what changes with every byte of the kernels and of what they import.

    Raises:
        FileNotFoundError: there are no kernels, so that none could be found stale.
    """
    kernels = sorted(package.rglob("*_kernels.py"))
    if not kernels:
        raise FileNotFoundError(f"no *_kernels.py under {package}: stale kernels would be used")
    constants = [core / name for name in CORE_CONSTANTS] + [package / name for name in CONSTANTS]
    digest = hashlib.sha256()
    for path in [*kernels, *constants]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
