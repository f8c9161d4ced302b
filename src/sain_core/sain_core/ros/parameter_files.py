"""Files of parameters, looked at before rcl opens them."""

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.untrusted.files import read_regular
from sain_core.untrusted.limits import YAML_BYTES

OPTION: Final = "--params-file"


def check_parameter_files(arguments: Sequence[str] | None) -> None:
    """Check the files that arguments name, or those of the process; rcl waits for any FIFO.

    Raises:
        ConfigError: one is no regular file, or too large.
    """
    for option, name in pairwise(sys.argv if arguments is None else arguments):
        if option != OPTION:
            continue
        try:
            read_regular(Path(name), YAML_BYTES)
        except UntrustedFileError as error:
            raise ConfigError(f"{OPTION} {name} is not read: {error}") from error
        except OSError:
            return  # rcl says why
