"""How kernels are compiled, and where they are kept: one folder for each version of the sources.

Numba checks only the file of a cached function, not the files of the functions it calls. After
an edit in one kernel module the others would go on with the old code, so the folder's name
carries a hash of all of them.
"""

import functools
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numba
from numba.extending import overload

import sain_core

OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy", "fastmath": {"contract", "arcp"}}


def keep_kernels_apart() -> None:
    """Send Numba's cache to the folder of these sources, unless NUMBA_CACHE_DIR says where."""
    if not os.environ.get("NUMBA_CACHE_DIR"):
        folder = _writable_root() / f"kernels-{_sources_hash()}"
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel: cached, division by zero gives infinity, a * b + c may be fused."""
    return _compile(function)


def compiled_apart(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that is called and not copied to where it is used: it compiles once."""
    return _compile(function, inline=False)


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


@functools.cache
def _sources_hash() -> str:
    package, core = Path(__file__).parents[1], Path(sain_core.__path__[0])
    columns = [
        core / "scene.py",
        core / "push.py",
        package / "network" / "features.py",
        package / "network" / "place_features.py",
    ]
    kernels = sorted(package.rglob("*_kernels.py"))
    if not kernels:  # kernels that moved away would never be found stale
        raise FileNotFoundError(f"no *_kernels.py under {package}: which kernels are stale?")
    digest = hashlib.sha256()
    for path in [Path(__file__), *kernels, *columns]:  # and constants
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache
def _writable_root() -> Path:
    """Return the user's cache folder, or a temporary one where that cannot be written."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sain"
    try:
        home.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=home):
            return home
    except OSError:
        return Path(tempfile.gettempdir()) / f"sain-{os.getuid()}"
