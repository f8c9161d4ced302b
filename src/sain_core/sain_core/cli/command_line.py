"""Command lines: how every executable is found, runs, fails and is interrupted.

A package declares its executables in ``commands.py``, each as a `Command` or a `NodeCommand`. What
is slow to import is imported after the arguments are checked. So help and errors come at once.
Ctrl-C ends a command quietly, with exit code 130.
"""

import os
import select
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final, get_type_hints

from sain_core.cli.arguments import read_options, split_ros_arguments
from sain_core.errors import INTERRUPTED, ConfigError, SainError
from sain_core.guarding.lifetime import PATIENCE, check_host, start_timer


def executable(package: str, name: str) -> Path:
    """Return the file that ``ros2 run PACKAGE NAME`` starts; raises `ConfigError`: none is."""
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for prefix in prefixes:
        path = Path(prefix, "lib", package, name)
        if os.access(path, os.X_OK):
            return path
    raise ConfigError(
        f"{package} {name} is not installed under AMENT_PREFIX_PATH; run inside ./env, or source"
        " the workspace's install/setup.bash"
    )


def command_of_node(
    package: str, name: str, ros: Sequence[str] = (), **parameters: object
) -> list[str]:
    """Return what starts a node, with arguments for ROS and parameters; raises as `executable`."""
    given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
    return [str(executable(package, name)), "--ros-args", *ros, *given]


@contextmanager
def end_with_the_reader() -> Iterator[None]:
    """End the process with exit code 0 where nobody reads standard output any more."""
    try:
        yield
    except BrokenPipeError:
        if not _reader_is_gone():  # it was another pipe
            raise
        raise SystemExit(0) from None
    finally:
        try:
            sys.stdout.flush()
        except BrokenPipeError:  # what is left goes nowhere, also when Python itself ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _reader_is_gone() -> bool:
    look = select.poll()
    look.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in look.poll(0))


LONGEST: Final = 4000  # characters of an error
BRINGS: Final = {  # packages that `pip install .` or a ROS 2 does not have, and what does
    **dict.fromkeys(("control_msgs", "vision_msgs"), "./env --with robots true builds it"),
    **dict.fromkeys(("viser", "websockets"), "pip install viser websockets brings it"),
}
WRONG_USAGE: Final = 2  # exit code after an argument that is not allowed


@dataclass(frozen=True)
class Command:
    """The entry point of an executable, which is one file.

    Its function ``run(options, console)`` does the work, and returns the exit code, or None for 0.
    The annotation of `options` is the dataclass of the settings, whose docstring is the text of the
    help. Where their defaults depend on the arguments, a function ``options(arguments)`` returns
    the dataclass. What is slow to import, the file imports inside of its functions.
    """

    name: str  # package and executable, as after ``ros2 run``
    module: str  # the file, as a module in the package
    resumes: str = ""  # what it continues from after Ctrl-C; "": it starts again
    ros: bool = False  # whether it accepts ``--ros-args``
    without_ros: str = ""  # an option with which it needs no ROS 2
    prefixes: bool = False  # whether nested settings are ``--group.name``; otherwise ``--name``
    alias: str = ""  # as a subcommand of ``sain``, where another command has the same name

    @property
    def subcommand(self) -> str:
        """Its name as a subcommand of ``sain``."""
        return self.alias or self.name.split()[1]

    @property
    def needs_ros(self) -> bool:
        """Whether it does nothing without ROS 2."""
        return self.ros or self.module.startswith("ros.")

    @property
    def summary(self) -> str:
        """What it does, in one sentence."""
        return " ".join((self.options().__doc__ or "").split("\n\n")[0].split())

    def options(self, arguments: Sequence[str] = ()) -> type:
        """Return the dataclass of its options, with the defaults that these arguments ask for."""
        if hasattr(self.file, "options"):
            return self.file.options(arguments)
        return get_type_hints(self.file.run)["options"]

    @property
    def file(self) -> Any:
        """Its file as a module."""
        return load(self.name, self.module)

    def __call__(self, arguments: list[str] | None = None, program: str = "") -> int:
        """Run it with these arguments, or those of the process; return its exit code.

        `program` is its name in the help; by default that after ``ros2 run``.
        """
        with end_with_the_reader():
            code = self._read_and_run(arguments, program or f"ros2 run {self.name}")
        if self.needs_ros and arguments is None:
            start_timer(PATIENCE, code)  # the middleware is taken down with the interpreter
        return code

    def _read_and_run(self, arguments: list[str] | None, program: str) -> int:
        given = sys.argv[1:] if arguments is None else arguments
        own = split_ros_arguments(given)[0] if self.ros else given
        begun = False
        try:
            options = read_options(self.options(own), program, own, self.prefixes)
            if self.ros:
                check_host()
            begun = True
            return self._run(options)
        except SainError as error:
            return self._fail(
                error, 1 if begun or not isinstance(error, ConfigError) else WRONG_USAGE
            )
        except KeyboardInterrupt:
            if begun and self.resumes:
                sys.stderr.write(
                    f"stopped; the same command continues from the last whole {self.resumes}\n"
                )
            return INTERRUPTED

    def _run(self, options: Any) -> int:
        from rich.console import Console

        class Output(Console):
            def on_broken_pipe(self) -> None:  # by default it ends the process, with exit code 1
                raise  # noqa: PLE0704 - rich calls this where it handles the error

        with naming_what_is_missing():
            return self.file.run(options, Output(soft_wrap=True)) or 0  # a terminal wraps by itself

    def _fail(self, error: SainError, code: int) -> int:
        from rich.console import Console

        console = Console(stderr=True, soft_wrap=True)
        name = self.name.rpartition(" ")[2]
        # What files from elsewhere hold may be in it, and must not steer the terminal.
        shown = (char if char.isprintable() or char == "\n" else "\ufffd" for char in str(error))
        text = "".join(shown)[:LONGEST]
        console.print(f"{name}: {text}", style="red", markup=False, highlight=False)
        return code


def load(command: str, path: str) -> Any:
    """Return a module in the package of a command, or what stands there as ``module:name``."""
    name, _, item = path.partition(":")
    with naming_what_is_missing():
        module = import_module(f"{command.split()[0]}.{name}")
    return getattr(module, item) if item else module


@contextmanager
def naming_what_is_missing() -> Iterator[None]:
    """Raise `ConfigError` in place of an import that fails where `BRINGS` has the package."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in BRINGS:
            raise
        raise ConfigError(f"needs {package}, which is not installed; {BRINGS[package]}") from None
