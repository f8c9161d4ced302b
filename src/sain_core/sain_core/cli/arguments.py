"""Arguments of commands as dataclasses of settings, and in words what is wrong with them.

tyro reads them. Its errors are boxes of many lines; here each is one line with what is allowed.
"""

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from inspect import cleandoc
from pathlib import Path
from textwrap import TextWrapper
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args, get_type_hints

from sain_core.config import describe_values
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import nearest
from sain_core.guarding.untrusted import user_path

if TYPE_CHECKING:
    from tyro._arguments import ArgumentDefinition
    from tyro._errors import ParseErrorEvent
    from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo


def read_options(kind: type, program: str, arguments: list[str], prefixes: bool = False) -> Any:
    """Return a dataclass of options as the arguments ask for, without those for ROS.

    Raises `ConfigError`: an argument that is unknown, missing or not allowed; `SystemExit` after
    help.
    """
    import tyro

    describe_options(kind)

    def refuse(event: "ParseErrorEvent") -> None:  # tyro would print a box of many lines
        if problem := _problem(event, kind, prefixes):
            raise ConfigError(problem)

    try:
        with tyro._errors.on_parse_error(refuse):
            return tyro.cli(
                kind,
                prog=program,
                description=_wrapped_docstring(kind),
                args=arguments,
                config=() if prefixes else (tyro.conf.OmitArgPrefixes,),
                registry=_paths(),
            )
    except ConfigError as error:  # that of a nested class of settings has come through tyro
        raise ConfigError(_name_argument(str(error), kind, prefixes)) from error


KINDS: Final[dict[Any, str]] = {int: "a whole number", float: "a number", Path: "a path"}


def _problem(event: "ParseErrorEvent", kind: type, prefixes: bool) -> str:
    """Return what is wrong with the arguments, and what is allowed, on one line."""
    from tyro import _errors

    match event:
        case _errors.InstantiationFailure(argument=argument, message=message):
            if not argument:
                return message
            return f"{argument.display_name()} is {_quoted(message)}; {_allowed(argument, kind)}"
        case _errors.InvalidChoice(argument=argument, value=value, choices=choices):
            allowed = ", ".join(choices)
            return f"{argument.display_name()} is {value!r}; it must be one of {allowed}"
        case _errors.BadValue(argument=argument):
            return f"{argument.display_name()} has no value; {_allowed(argument, kind)}"
        case _errors.UnrecognizedArgs(tokens=[*tokens]) if tokens:
            return _unknown(tokens, kind, prefixes)
        case _errors.MissingArgs(unrecognized_tokens=[*tokens]) if tokens:
            return _unknown(tokens, kind, prefixes)
        case _errors.MissingArgs(missing_arguments=missing):
            names = [one.arg.display_name() for one in missing]
            texts = [_declared(one.arg, kind).get("description", "") for one in missing]
            are = "are" if names[1:] else "is"
            return f"{' and '.join(names)} {are} missing; what to give: {'; '.join(texts)}"
    return ""


def _quoted(message: str) -> str:
    """Return what could not be parsed, as the message of tyro quotes it."""
    found = re.search(r"\[(.*?)\]|('.*')$", message)
    return next(filter(None, found.groups()), "") if found else repr(message)


def _scalars(hint: Any) -> list[Any]:
    """Return the types of single values in a type."""
    parts = [one for one in get_args(hint) if one not in (Ellipsis, type(None))]
    return [one for part in parts for one in _scalars(part)] if parts else [hint]


def _allowed(argument: "ArgumentDefinition", kind: type) -> str:
    """Return in words which values an argument can have."""
    scalars = _scalars(argument.field.type_stripped)
    words = " or ".join(dict.fromkeys(KINDS.get(one, "a text") for one in scalars))
    if len(scalars) > 1 and len({*scalars}) == 1:
        words = f"{len(scalars)} values, each {words}"
    values = describe_values(_declared(argument, kind))
    return f"it must be {', '.join(filter(None, (words, values)))}"


def _declared(argument: "ArgumentDefinition", kind: type) -> Mapping[str, Any]:
    """Return the metadata of the field that an argument is for."""
    *groups, name = filter(
        None, f"{argument.intern_prefix}.{argument.field.intern_name}".split(".")
    )
    for group in groups:
        kind = get_type_hints(kind)[group]
    return next(item.metadata for item in fields(kind) if item.name == name)


def _unknown(tokens: Sequence[str], kind: type, prefixes: bool) -> str:
    """Return in words that there are no such arguments, and which one is alike."""
    token = next((one for one in tokens if one.startswith("-")), tokens[0])
    name = token.partition("=")[0].replace("_", "-")
    names = {
        f"--{group if prefixes else ''}{item.name}".replace("_", "-")
        for settings, group in _groups(kind)
        for item in fields(settings)
        if item.init
    }
    alike = nearest(name, names - {name})
    hint = f"did you mean {alike[0]}?" if alike else "--help lists what there is"
    return f"{'there is no option' if token[0] == '-' else 'there is no place for'} {token}; {hint}"


def _groups(kind: type, prefix: str = "") -> Iterator[tuple[type, str]]:
    """Yield a class of settings and those nested in it, with the prefixes of their arguments."""
    yield kind, prefix
    bare, hints = get_type_hints(kind), get_type_hints(kind, include_extras=True)
    for name, nested in bare.items():
        if isinstance(nested, type) and is_dataclass(nested):
            marks = getattr(hints[name], "__metadata__", ())
            given = [mark.name for mark in marks if getattr(mark, "name", None) is not None]
            group = [*given, name][0]
            yield from _groups(nested, f"{prefix}{group}." if group else prefix)


def _paths() -> "ConstructorRegistry":
    """Return how arguments become paths: ``~`` is the home folder; an empty one is refused.

    The shell leaves ``--out=~/mine`` as it is, and an unset variable makes ``--out ""``: as paths
    they would be a folder called ``~``, and the folder that the user is in.
    """
    from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec

    def path(texts: list[str]) -> Path:
        if not texts[0]:
            raise ValueError("''")
        return user_path(texts[0])

    registry = ConstructorRegistry()

    @registry.primitive_rule
    def rule(kind: "PrimitiveTypeInfo") -> "PrimitiveConstructorSpec[Path] | None":
        if kind.type is not Path:
            return None
        return PrimitiveConstructorSpec(
            1, "PATH", path, lambda value: isinstance(value, Path), lambda value: [str(value)]
        )

    return registry


def _wrapped_docstring(kind: type) -> str:
    """Return what a class says of itself in lines of the terminal.

    tyro wraps its tables alone, and joins lines again that begin with a letter.
    """
    wrap = TextWrapper(min(shutil.get_terminal_size().columns, 100), subsequent_indent="  ")
    paragraphs = cleandoc(kind.__doc__ or "").split("\n\n")
    return "\n\n".join(wrap.fill(" ".join(one.split())) for one in paragraphs)


@cache  # a second description would stand beside the first, and each slows down every parse
def describe_options(settings: type) -> None:
    """Let `tyro` find the descriptions of a settings class and of those nested in it.

    They stand in the fields' metadata, where it does not look; it does look at annotations.
    Meant for entry points: the annotations of the class itself are changed.
    """
    import tyro

    bare, hints = get_type_hints(settings), get_type_hints(settings, include_extras=True)
    for item in fields(settings):
        kind = hints[item.name]
        if isinstance(nested := bare[item.name], type) and is_dataclass(nested):
            describe_options(nested)
        elif description := item.metadata.get("description"):
            choices = item.metadata.get("choices")
            allowed = "" if choices else describe_values(item.metadata)
            notes = " ".join(filter(None, (allowed, item.metadata.get("unit"))))
            text = description[:1].upper() + description[1:] + (f" [{notes}]" if notes else "")
            if choices and kind is str:
                kind = Literal[tuple(choices)]
            settings.__annotations__[item.name] = Annotated[kind, tyro.conf.arg(help=text)]


def split_ros_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return the arguments of the program and those for ROS: from ``--ros-args`` up to ``--``."""
    own: list[str] = []
    ros: list[str] = []
    target = own
    for argument in arguments:
        if argument == "--ros-args":
            target = ros
        elif argument == "--" and target is ros:
            target = own
        else:
            target.append(argument)
    return own, ros


def _name_argument(message: str, options: type, prefixes: bool) -> str:
    """Return the message of a `Config` with the argument's name in place of the field's."""
    kind, dot, rest = message.partition(".")
    group = next((prefix for one, prefix in _groups(options) if one.__name__ == kind), None)
    if not dot or group is None:
        return message
    name, _, problem = rest.partition(" ")
    return f"--{group if prefixes else ''}{name} {problem}".replace("_", "-", name.count("_"))
