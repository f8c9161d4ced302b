"""Settings on the command line: `--help` says of each what its `option` says."""

from dataclasses import fields, is_dataclass
from typing import Annotated, get_type_hints

import tyro


def describe_options(settings: type) -> None:
    """Let `tyro` find the descriptions of a settings class and of those nested in it.

    They stand in the fields' metadata, where it does not look; it does look at annotations.
    Meant for entry points: the annotations of the class itself are changed.
    """
    hints = get_type_hints(settings, include_extras=True)
    for item in fields(settings):
        if isinstance(item.type, type) and is_dataclass(item.type):
            describe_options(item.type)
        elif description := item.metadata.get("description"):
            unit = f" [{item.metadata['unit']}]" if item.metadata.get("unit") else ""
            text = description[:1].upper() + description[1:] + unit
            settings.__annotations__[item.name] = Annotated[
                hints[item.name], tyro.conf.arg(help=text)
            ]
