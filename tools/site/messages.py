"""The page of messages, services and actions, made from their definitions."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "src" / "sain_interfaces"
KINDS = {"msg": "Messages", "srv": "Services", "action": "Actions"}
PARTS = {
    "msg": ("",),
    "srv": ("Request", "Reply"),
    "action": ("Goal", "Result", "Feedback"),
}
INTRODUCTION = """# Messages, services and actions

For users who connect their own nodes: every definition of `sain_interfaces`, with its comments.
[Architecture](../explanation/architecture.md#the-graph) shows which node publishes and serves what.
"""
FIELD = re.compile(
    r"(?P<type>[\w/\[\]<=]+) +(?P<name>\w+) *(?:= *(?P<value>[^#\s]+))? *(?:# *(?P<note>.*))?$"
)


@dataclass
class Field:
    """A field or a constant of a definition."""

    type: str
    name: str
    note: str
    value: str


def pages() -> dict[str, str]:
    """Return the page, by its place in the site."""
    text = [INTRODUCTION]
    names = {path.stem for path in FOLDER.rglob("*.msg")}
    for kind, title in KINDS.items():
        text.append(f"\n## {title}\n")
        for path in sorted((FOLDER / kind).iterdir()):
            text += definition(path, names)
    return {"reference/messages.md": "\n".join(text)}


def definition(path: Path, names: set[str]) -> Iterator[str]:
    """Yield the lines about one definition: what it is for, and a table for each of its parts."""
    kind = path.suffix[1:]
    about, parts = read_definition(path.read_text(encoding="utf-8"))
    yield f"### {path.stem}\n\n`sain_interfaces/{kind}/{path.stem}`\n\n{escape(about)}\n"
    for title, fields in zip(PARTS[kind], parts, strict=True):
        if title:
            yield f"**{title}**" + ("\n" if fields else ": nothing.\n")
        if fields:
            noted = any(item.note for item in fields)
            yield "| field | type | meaning |" if noted else "| field | type |"
            yield "| --- | --- | --- |" if noted else "| --- | --- |"
            yield from (row(item, names, noted) for item in fields)
            yield ""


def read_definition(text: str) -> tuple[str, list[list[Field]]]:
    """Return the leading comment of a definition, and the fields of each of its parts."""
    about, parts, begun = [], [[]], False
    for line in text.splitlines():
        bare = line.strip()
        if bare == "---":
            parts.append([])
            begun = True
        elif bare.startswith("#") and not begun:
            about.append(bare.lstrip("# "))
        elif bare.startswith("#") and parts[-1]:
            parts[-1][-1].note += " " + bare.lstrip("# ")
        elif bare:
            found = FIELD.match(bare)
            if found is None:
                raise ValueError(f"no field of a message: {line!r}")
            parts[-1].append(
                Field(found["type"], found["name"], found["note"] or "", found["value"] or "")
            )
            begun = True
    return " ".join(about), parts


def row(item: Field, names: set[str], noted: bool) -> str:
    """Return a field as a row; types of this package lead to their definition."""
    own = re.sub(r"\[.*", "", item.type)
    shown = f"[`{item.type}`](#{own.lower()})" if own in names else f"`{item.type}`"
    name = f"`{item.name} = {item.value}`" if item.value else f"`{item.name}`"
    return f"| {name} | {shown} |" + (f" {escape(item.note)} |" if noted else "")


def escape(text: str) -> str:
    """Return the text of a comment as Markdown."""
    return re.sub(r"([|*<\[\]])", r"\\\1", text)
