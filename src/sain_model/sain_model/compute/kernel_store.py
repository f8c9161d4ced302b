"""Where compiled kernels are kept, whether all are there, and how they get there.

They stand beside the sources, as Python's own compiled files do, in a folder named by a hash of all
that is frozen into the machine code: the path of the checkout does not matter. Nothing here imports
Numba: to see that all kernels are there takes some milliseconds.
"""

import fcntl
import functools
import hashlib
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from importlib.metadata import version
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final

import sain_core
from sain_core.cli.terminal import WaitingLine
from sain_core.errors import ModelUnavailableError, OutputError
from sain_core.guarding.lifetime import alive
from sain_core.output import make_folder, remove, sign
from sain_core.scratch import cache_folder

if TYPE_CHECKING:
    from rich.console import Console

Report = Callable[[int, int], None]  # of compiled kernels, and of all that were missing

PACKAGE: Final = Path(__file__).resolve().parents[1]
CORE: Final = Path(sain_core.__path__[0]).resolve()
SUFFIX: Final = "_kernels.py"
DECORATORS: Final = Path("compute", "compiling.py")
COMPILER: Final = "sain_model.cli.kernels"
CHAINS: Final = ("pushes", "network")  # what the compiler does side by side
COMPILES: Final = "SAIN_COMPILES_KERNELS"  # set in the compiler's processes
POLL_PERIOD: Final = 0.1  # [s]
HASH_LENGTH: Final = 16  # digits in the name of a folder
IMPORT: Final = re.compile(r"^from (sain_core|sain_model)\.([\w.]+) import", re.MULTILINE)
KERNEL: Final = re.compile(r"^@(?:compiled\w*|callable_kernel)\ndef (\w+)", re.MULTILINE)


def kernels_are_ready() -> bool:
    """Return whether all kernels of these sources are compiled."""
    return _stamp().exists()


def compile_kernels(report: Report | None = None) -> None:
    """Return when all kernels of these sources are compiled; at once where they are already.

    One process compiles, on all cores. Others that call this during that time wait for it.

    Args:
        report: is called again and again with how many kernels have been compiled, and of how many
            that were missing.

    Raises:
        ModelUnavailableError: they cannot be compiled; with the end of what the compiler printed.
    """
    if COMPILES in os.environ or kernels_are_ready():
        return
    missing = len(_missing())

    def tell() -> None:
        if report is not None and missing:
            report(missing - len(_missing()), missing)

    make_folder(kernel_folder())
    with (kernel_folder() / "lock").open("a") as lock:
        while not _alone(lock):
            _wait(tell)
        if not kernels_are_ready():
            _compile(tell)
            _sign_kernels()


# --- what is to be compiled -----------------------------------------------------------------------


def source_hash(package: Path = PACKAGE, core: Path = CORE) -> str:
    """Return a hash of all that the machine code of kernels is made from.

    That is the kernels, the modules whose constants they import, and how kernels are compiled.
    Raises `FileNotFoundError`: there are no kernels, so that none could be found stale.
    """
    kernels = sorted(package.rglob(f"*{SUFFIX}"))
    if not kernels:
        raise FileNotFoundError(f"no *{SUFFIX} under {package}: stale kernels would be used")
    roots, sources = {"sain_model": package, "sain_core": core}, {package / DECORATORS, *kernels}
    for path in kernels:
        for root, module in IMPORT.findall(path.read_text()):
            sources.add(roots[root].joinpath(*module.split(".")).with_suffix(".py"))
    digest = hashlib.sha256()
    for path in sorted(sources, key=lambda path: path.name):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:HASH_LENGTH]


# --- where it is kept -----------------------------------------------------------------------------


@functools.cache
def kernel_folder() -> Path:
    """Return where compiled kernels are kept.

    That is beside the sources, or in the user's cache where that folder cannot be written. The
    variable ``NUMBA_CACHE_DIR`` overrides both.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    beside = PACKAGE / "__pycache__" / "kernels"
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=beside):
            return beside
    except OSError:
        return cache_folder() / "kernels"


@functools.cache
def compiled_folder() -> Path:
    """Return the folder of what is compiled from these sources."""
    return kernel_folder() / f"kernels-{source_hash()}"


@functools.cache
def _stamp() -> Path:
    """The file that is there when all kernels are, for this Python, Numba and processor."""
    made_by = repr((platform.python_version(), version("numba"), _processor())).encode()
    digest = hashlib.sha256((PACKAGE / "cli" / "kernels.py").read_bytes() + made_by)
    return compiled_folder() / f"complete-{digest.hexdigest()[:HASH_LENGTH]}"


def _processor() -> str:
    """Return what machine code is made for: the model and the instructions of the processor."""
    with suppress(OSError), Path("/proc/cpuinfo").open() as lines:
        named = [line for line in lines if line.startswith(("model name", "flags", "Features"))]
        return "".join(dict.fromkeys(named))
    return platform.processor()


@functools.cache
def _kernels() -> frozenset[str]:
    """The names of all kernels, with those of their modules."""
    paths = PACKAGE.rglob(f"*{SUFFIX}")
    return frozenset(
        f"{path.stem}.{name}" for path in paths for name in KERNEL.findall(path.read_text())
    )


def _missing() -> frozenset[str]:
    """The kernels that are not compiled. Numba names a file module.function-line.version.nbi."""
    return _kernels() - {file.name.partition("-")[0] for file in compiled_folder().glob("*.nbi")}


def _sign_kernels() -> None:
    """Name in the manifest what this process has had compiled, and remove what is outdated."""
    _stamp().touch()
    sign(compiled_folder() / "*.nb[ic]", grows=True)
    sign(_stamp())
    ours = re.compile(rf"kernels-[0-9a-f]{{{HASH_LENGTH}}}")
    for path in kernel_folder().resolve().iterdir():
        if ours.fullmatch(path.name) and path.name != compiled_folder().name:
            with suppress(OutputError):  # of others: they may keep theirs here, too
                remove(path)


# --- how it gets there ----------------------------------------------------------------------------


def _alone(lock: IO[str]) -> bool:
    """Return whether no other process compiles; from now on no other one will."""
    with suppress(BlockingIOError):
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _compile(tell: Callable[[], None]) -> None:
    """Run the compiler in a process for each chain: LLVM works for one thread of a process."""
    with ExitStack() as stack:
        outputs = [stack.enter_context(tempfile.TemporaryFile()) for _ in CHAINS]
        children = list(map(_start_compiler, CHAINS, outputs))
        try:
            while any(child.poll() is None for child in children):
                _wait(tell)
        finally:
            for child in children:
                child.kill()
                child.wait()
        for child, output in zip(children, outputs, strict=True):
            if child.returncode != 0:
                output.seek(0)
                printed = output.read().decode(errors="replace").strip().splitlines()
                failed = f"the compiler ended with {child.returncode}"
                raise ModelUnavailableError(
                    "\n".join([f"the kernels cannot be compiled; {failed}:", *printed[-5:]])
                )


def _start_compiler(chain: str, output: IO[bytes]) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", COMPILER, "--chain", chain],
        env={**os.environ, COMPILES: chain},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=output,
    )


def _wait(tell: Callable[[], None]) -> None:
    tell()
    alive()
    time.sleep(POLL_PERIOD)


# --- what is said meanwhile -----------------------------------------------------------------------


def describe_progress(finished: int, total: int) -> str:
    """Return in words how many kernels have been compiled."""
    return f"compiling {finished} of {total} kernels"


def describe_compilation() -> str:
    """Return in words what is compiled before any model predicts; empty: all is."""
    kernels, missing = len(_kernels()), len(_missing())
    return "" if kernels_are_ready() else describe_progress(kernels - missing, kernels)


def compile_visibly(console: "Console | None" = None) -> None:
    """Return when all kernels are compiled, at once where they are; show how far that is.

    By default on standard error.
    Raises `ModelUnavailableError`: they cannot be compiled.
    """
    if kernels_are_ready():
        return
    if console is None:
        from rich.console import Console

        console = Console(stderr=True)
    with WaitingLine(console, 0.0) as line:
        compile_kernels(lambda finished, total: line.say(describe_progress(finished, total)))
