"""How kernels are compiled. Where they are kept is in `sain_model.compute.kernel_store`."""

from collections.abc import Callable
from types import FunctionType
from typing import Any, Final, Self

import numba
import numpy as np
from numba.core.caching import _CacheLocator
from numba.core.codegen import get_host_cpu_features

from sain_model.compute.kernel_store import compiled_folder

OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy", "fastmath": {"contract", "arcp"}}
# What lets Python call a kernel is a third of its compilation; most are called by kernels alone.
NOT_FROM_PYTHON: Final = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# Numba counts who uses an array wherever a kernel takes one out of a tuple. Kernels that make and
# return no arrays need no counts, and run in half of the time.
NO_COUNTS: Final = {**NOT_FROM_PYTHON, "_nrt": False}


def _use_wide_vectors() -> None:
    """Let kernels use vectors of 512 bits where there are any: LLVM prefers 256 on most processors.

    The network takes three quarters of the time, and computes the same.
    """
    config: Any = numba.config
    features = get_host_cpu_features()
    if config.CPU_FEATURES is None and "+avx512f" in features:
        config.CPU_FEATURES = f"{features},-prefer-256-bit"


_use_wide_vectors()


def plain(array: np.ndarray) -> np.ndarray:
    """Return an array as kernels are compiled for it; copied only where it is of another kind.

    A read-only array or one with gaps would make Numba compile its kernel once more, for seconds.
    """
    return np.require(array, np.float64, ["C_CONTIGUOUS", "ALIGNED", "WRITEABLE"])


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel for kernels, that makes no arrays: it is copied to where it is used."""
    return _compile(function, forceinline=True, **NO_COUNTS)


def compiled_apart(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel as `compiled` does, and do not copy it to where it is used."""
    return _compile(function, **NO_COUNTS)


def compiled_with_arrays(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel as `compiled` does, that makes or returns arrays."""
    return _compile(function, forceinline=True, **NOT_FROM_PYTHON)


def callable_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that Python calls."""
    return _compile(function)


def _compile(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    """Compile: kept on disk, division by zero gives infinity, a * b + c may be fused.

    Kernels let go of Python's lock: `sain_model.compute.threads` runs them side by side.
    """
    config: Any = numba.config
    njit: Any = numba.njit
    others, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, f"{__name__}.BySources"
    try:
        kernel: Callable[..., Any] = njit(cache=True, nogil=True, **OPTIONS, **options)(function)
    finally:
        config.CACHE_LOCATOR_CLASSES = others
    return kernel


class BySources(_CacheLocator):
    """Tells Numba to keep kernels in the folder of all that they are made from.

    Numba itself looks at the path and the content of the kernel's own file alone. After an edit in
    one module, those that call it would run the old code.
    """

    def __init__(self, line: int) -> None:
        self._line = line

    @classmethod
    def from_function(cls, py_func: FunctionType, py_file: str) -> Self:
        """Return the locator of a function."""
        located = cls(py_func.__code__.co_firstlineno)
        located.ensure_cache_path()
        return located

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(compiled_folder())

    def get_source_stamp(self) -> str:
        """Return what differs for other sources."""
        return compiled_folder().name

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart."""
        return str(self._line)
