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
    GOAL_LOST = 21


class SainError(Exception):
    """Base of every error that SAIN raises on purpose; `code` says which kind it is on the wire."""

    code = ErrorCode.INTERNAL

    def __init_subclass__(cls, code: ErrorCode = ErrorCode.INTERNAL) -> None:
        """Declare a kind of error."""
        cls.code = code


class InvalidInputError(SainError, ValueError, code=ErrorCode.INVALID):
    """An array of the wrong shape, or one that holds NaN or Inf."""


class OutOfRangeError(SainError, ValueError, code=ErrorCode.OUT_OF_RANGE):
    """A number outside the range that is allowed for it."""


class StaleSceneError(SainError, code=ErrorCode.STALE_SCENE):
    """A push planned from a scene that is no longer the current, settled one."""


class BusyError(SainError, code=ErrorCode.BUSY):
    """A request that came while another one is being carried out."""


class UnknownEpisodeError(SainError, code=ErrorCode.UNKNOWN_EPISODE):
    """A request for an episode that is not the one running."""


class DuplicatePushError(SainError, code=ErrorCode.DUPLICATE_PUSH):
    """A push id that was seen before: each is executed at most once."""


class UnreachableError(SainError, code=ErrorCode.UNREACHABLE):
    """A push with a pose on its way that the arm cannot take, or a goal that needs one."""


class BlockedError(SainError, code=ErrorCode.BLOCKED):
    """A push on whose way the tool would touch a disk other than the mid disk."""


class OffTableError(SainError, ValueError, code=ErrorCode.OFF_TABLE):
    """A disk or a goal that does not lie on the table."""


class TooMuchWorkError(SainError, code=ErrorCode.TOO_MUCH_WORK):
    """A request larger than the server accepts."""


class ConfigError(SainError, ValueError, code=ErrorCode.CONFIG):
    """A setting with an unknown name, a wrong type or a value outside its range."""


class CheckpointError(SainError, code=ErrorCode.CHECKPOINT):
    """A checkpoint that is missing, damaged or of another version."""


class DatasetError(SainError, code=ErrorCode.DATASET):
    """A data set that is missing, damaged or lacks what is needed."""


class UntrustedFileError(DatasetError, ValueError, code=ErrorCode.DATASET):
    """A file that is not read: no regular file, or beyond a limit of `sain_core.guarding`.

    The message does not name the file. Who reads it does, in an error of its own kind.
    """


class ModelUnavailableError(SainError, code=ErrorCode.MODEL_UNAVAILABLE):
    """The model did not answer, answered late, or answered with NaN."""


class NoPushError(SainError, code=ErrorCode.NO_PUSH):
    """No push in the limits can be carried out from this scene."""


class NoProgressError(SainError, code=ErrorCode.NO_PROGRESS):
    """Pushes that bring nothing any more."""


class GoalLostError(SainError, code=ErrorCode.GOAL_LOST):
    """A goal that can no longer be reached: a body that was to be kept was moved."""


class OutputError(SainError, OSError, code=ErrorCode.OUTPUT):
    """An output folder that cannot be written, or that must not be overwritten."""


class CancelledError(SainError, code=ErrorCode.CANCELLED):
    """Work given up because something newer made it pointless."""


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
