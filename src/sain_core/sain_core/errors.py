"""One family of errors, and the codes that carry them across the wire.

Raise, never clip or drop in silence. A message says what was wrong and what would be right.
At a node's edge `error_reply` turns any of them into the ``error_code`` and
``error_message`` of a reply.
"""

from enum import IntEnum
from typing import Final

INTERRUPTED: Final = 130  # exit code of a process after Ctrl-C


class ErrorCode(IntEnum):
    """Why something was refused. 0 is not "fine by default": a reply nobody filled in says so."""

    UNKNOWN = 0
    OK = 1
    INVALID = 2  # wrong shape, NaN or Inf
    OUT_OF_RANGE = 3
    STALE_SCENE = 4
    BUSY = 5
    UNKNOWN_EPISODE = 6
    DUPLICATE_PUSH = 7
    UNREACHABLE = 8
    BLOCKED = 9
    OFF_TABLE = 10
    TOO_MUCH_WORK = 11
    CONFIG = 12
    CHECKPOINT = 13
    DATASET = 14
    MODEL_UNAVAILABLE = 15
    NO_PUSH = 16
    OUTPUT = 17
    CANCELLED = 18
    INTERNAL = 19
    NO_PROGRESS = 20


class SainError(Exception):
    """Base of every error that SAIN raises on purpose."""

    code = ErrorCode.INTERNAL


class InvalidInputError(SainError, ValueError):
    """An array of the wrong shape, or one that holds NaN or Inf."""

    code = ErrorCode.INVALID


class OutOfRangeError(SainError, ValueError):
    """A number outside the range that is allowed for it."""

    code = ErrorCode.OUT_OF_RANGE


class StaleSceneError(SainError):
    """A push planned from a scene that is no longer the current, settled one."""

    code = ErrorCode.STALE_SCENE


class BusyError(SainError):
    """A request that came while another one is being carried out."""

    code = ErrorCode.BUSY


class UnknownEpisodeError(SainError):
    """A request for an episode that is not the one running."""

    code = ErrorCode.UNKNOWN_EPISODE


class DuplicatePushError(SainError):
    """A push id that was seen before: each is executed at most once."""

    code = ErrorCode.DUPLICATE_PUSH


class UnreachableError(SainError):
    """A push with a pose on its way that the arm cannot take, or a goal that needs one."""

    code = ErrorCode.UNREACHABLE


class BlockedError(SainError):
    """A push on whose way the tool would touch a disk other than the mid disk."""

    code = ErrorCode.BLOCKED


class OffTableError(SainError, ValueError):
    """A disk or a goal that does not lie on the table."""

    code = ErrorCode.OFF_TABLE


class TooMuchWorkError(SainError):
    """A request larger than the server accepts."""

    code = ErrorCode.TOO_MUCH_WORK


class ConfigError(SainError, ValueError):
    """A setting with an unknown name, a wrong type or a value outside its range."""

    code = ErrorCode.CONFIG


class CheckpointError(SainError):
    """A checkpoint that is missing, damaged or of another architecture."""

    code = ErrorCode.CHECKPOINT


class DatasetError(SainError):
    """A data set that is missing, damaged or lacks what is needed."""

    code = ErrorCode.DATASET


class ModelUnavailableError(SainError):
    """The model did not answer, answered late, or answered with NaN."""

    code = ErrorCode.MODEL_UNAVAILABLE


class NoPushError(SainError):
    """No push in the limits can be carried out from this scene."""

    code = ErrorCode.NO_PUSH


class NoProgressError(SainError):
    """Pushes that bring nothing any more."""

    code = ErrorCode.NO_PROGRESS


class OutputError(SainError, OSError):
    """An output folder that cannot be written, or that must not be overwritten."""

    code = ErrorCode.OUTPUT


class CancelledError(SainError):
    """Work given up because something newer made it pointless."""

    code = ErrorCode.CANCELLED


def error_reply(error: BaseException) -> tuple[int, str]:
    """Return the ``error_code`` and ``error_message`` that report this error to a peer."""
    if isinstance(error, SainError):
        return int(error.code), str(error)
    return int(ErrorCode.INTERNAL), f"{type(error).__name__}: {error}"


def error_from_reply(code: int, message: str) -> SainError:
    """Return the error that a peer reported; raise it where its reply was needed."""
    for kind in SainError.__subclasses__():
        if kind.code == code:
            return kind(message)
    return SainError(f"the peer answered with code {code}: {message or 'no message'}")
