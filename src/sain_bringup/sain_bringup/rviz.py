"""The view that RViz opens, for a graph in any namespace."""

import tempfile
from pathlib import Path
from typing import Final

NAMESPACE: Final = "/sain"  # of the topics in the file
NO_PREFIX: Final = 'TF Prefix: ""'


def view_of(namespace: str, config: Path) -> Path:
    """Return the file with a namespace's topics and frames: the given one for ``/sain``.

    RViz cannot be told a namespace of its topics, so another one needs a file of its own.
    """
    name = namespace.strip("/")
    if f"/{name}" == NAMESPACE:
        return config
    text = config.read_text().replace(f"{NAMESPACE}/", f"/{name}/" if name else "/")
    if name:
        text = text.replace(NO_PREFIX, f"TF Prefix: {name}")
    with tempfile.NamedTemporaryFile("w", suffix=".rviz", delete=False) as file:
        file.write(text)
    return Path(file.name)
