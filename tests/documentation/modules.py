"""Whether a module that is started with ``python -m`` accepts its arguments."""

import argparse
import contextlib
import functools
import io
import re
import runpy
import sys
from collections.abc import Iterator
from typing import Any, NoReturn

import tyro

from tests.paths import ROOT

WITHOUT_PARSER = {  # modules, with what they accept
    "benchmarks": None,  # names of benchmarks, which it checks by itself
    "sain_model.cli.kernels": 0,
    "mkdocs": None,
}
PARSER = re.compile(r"\btyro\.cli\(|\bread_options\(|\bArgumentParser\(")


class Parsed(BaseException):
    """Raised in place of the work of a program whose arguments are read."""


def module_problem(name: str, words: list[str]) -> Iterator[str]:
    """What a module refuses; it reads its arguments and does nothing else."""
    if name in WITHOUT_PARSER:
        most = WITHOUT_PARSER[name]
        if most is not None and len(words) > most:
            yield f"{name} takes {most} arguments, not {words}"
        return
    place = ROOT / name.replace(".", "/")
    package = place / "__main__.py"
    source = package if package.exists() else place.with_suffix(".py")
    if not source.exists():
        yield f"there is no module {name}"
        return
    if not PARSER.search(source.read_text()):
        yield from [f"{name} takes no arguments, not {words}"] if words else []
        return
    output, before = io.StringIO(), sys.argv
    sys.argv = [name, *words]
    sys.modules.pop(name, None)  # another page may have imported it
    try:
        with parsers_stop(), contextlib.redirect_stderr(output), contextlib.redirect_stdout(output):
            runpy.run_module(name, run_name="__main__")
        yield f"{name} did not read its arguments"
    except Parsed:
        pass
    except SystemExit as end:
        if end.code:
            yield f"{name} {' '.join(words)}: {' '.join(output.getvalue().split())}"
    finally:
        sys.argv = before


@contextlib.contextmanager
def parsers_stop() -> Iterator[None]:
    """Let tyro and argparse end a program once they have read its arguments."""
    cli, parse = tyro.cli, argparse.ArgumentParser.parse_args

    def stop_cli(kind: Any, **settings: Any) -> NoReturn:
        argparse.ArgumentParser.parse_args = parse  # type: ignore[method-assign]
        cli(kind if isinstance(kind, type) else without_work(kind), **settings)
        raise Parsed

    def stop_parse(self: argparse.ArgumentParser, *given: Any, **settings: Any) -> NoReturn:
        parse(self, *given, **settings)
        raise Parsed

    tyro.cli, argparse.ArgumentParser.parse_args = stop_cli, stop_parse  # type: ignore[assignment]
    try:
        yield
    finally:
        tyro.cli, argparse.ArgumentParser.parse_args = cli, parse  # type: ignore[method-assign]


def without_work(function: Any) -> Any:
    """A function with the same arguments, which ends there."""

    @functools.wraps(function)
    def stop(*_: Any, **__: Any) -> NoReturn:
        raise Parsed

    return stop
