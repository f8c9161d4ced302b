"""Errors of an environment that are SAIN's and Gymnasium's at once."""

from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from sain_core.errors import ErrorCode, SainError, StaleSceneError


class EpisodeEndedError(StaleSceneError, ResetNeeded, code=ErrorCode.STALE_SCENE):
    """A step without an episode: it has ended, or none has begun."""


class EnvironmentClosedError(SainError, ClosedEnvironmentError):
    """A call of an environment that was closed."""
