"""How much is read of a file that somebody else may have made: all limits in one place.

An honest file is far below them. Above one of them a file is refused before it is read.
"""

from typing import Final

from sain_core.errors import UntrustedFileError

MIB: Final = 1 << 20

# Documents: JSON and YAML
JSON_BYTES: Final = 64 * MIB
YAML_BYTES: Final = 2 * MIB
DEPTH: Final = 64  # lists and objects inside each other
JSON_ITEMS: Final = 4_000_000  # values, lists and objects
YAML_EVENTS: Final = 200_000
DIGITS: Final = 100  # of one number

# What is compressed: chunks of MCAP, files and messages of rosbag2, arrays of npz
FREE_BYTES: Final = 64 * MIB  # that any file may unpack to
RATIO: Final = 200  # and so many more for each byte of the file
PIECE_BYTES: Final = 128 * MIB  # of one chunk, record or message

PIECE_RECORDS: Final = 5_000_000  # the smallest messages of a piece are 4.3 million

# Bags
FREE_MESSAGES: Final = 500_000  # of any file
BYTES_A_MESSAGE: Final = 8  # of the file, for each more: its index alone has 16
SUMMARY_BYTES: Final = 64 * MIB
TOPICS: Final = 10_000
NAME_LENGTH: Final = 1_000  # characters of a topic or a type

# Definitions of messages (ros2msg), and messages that are decoded field by field
DEFINITION_BYTES: Final = MIB
DEFINITION_FIELDS: Final = 5_000
DEFINITION_DEPTH: Final = 32  # types inside each other
DEFINITION_LINE: Final = 4_000  # characters of a line without its comment
ARRAY_LENGTH: Final = 1_000_000  # that a definition fixes
DECODED_BYTES: Final = MIB
DECODING_SECONDS: Final = 3.0  # of processor time, for any file
DECODING_SECONDS_A_MIB: Final = 20.0  # and so much more for each MiB of the file

# Data sets
BODIES: Final = 100
LARGEST_NUMBER: Final = 1e6  # of a scene or an action, in SI units

# Weights of a network, and other files that are read whole
WHOLE_BYTES: Final = 256 * MIB


def unpacked_bytes(size: int) -> int:
    """Return how much a file of this size [bytes] may unpack to [bytes]."""
    return FREE_BYTES + RATIO * size


def most_messages(size: int) -> int:
    """Return how many messages a file of this size [bytes] may have."""
    return FREE_MESSAGES + size // BYTES_A_MESSAGE


def decoding_seconds(size: int) -> float:
    """Return the processor time for decoding what is in a file of this size [bytes]."""
    return DECODING_SECONDS + DECODING_SECONDS_A_MIB * size / MIB


def limit(what: str, found: int, allowed: int) -> None:
    """Raise `UntrustedFileError` where a file has more of something than is allowed."""
    if found > allowed:
        raise UntrustedFileError(f"it has more than {allowed:,} {what}")


def too_deep() -> UntrustedFileError:
    """Return the error about a document that is nested too deep."""
    return UntrustedFileError(f"it is nested more than {DEPTH} deep")


def too_long(number: str) -> UntrustedFileError:
    """Return the error about a number with too many digits."""
    return UntrustedFileError(f"a number has {len(number):,} digits; allowed: {DIGITS}")
