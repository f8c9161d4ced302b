"""The model that is served now, and how another one takes its place. No middleware here."""

from collections.abc import Callable
from dataclasses import replace

from sain_core.dynamics import Dynamics
from sain_model.serving.server import ModelServer
from sain_model.serving.settings import ServingConfig


class LiveModel:
    """Holds one `ModelServer` at a time.

    A server never changes: whoever began with one finishes with it. Another one is made whole
    beside it, on any thread, and takes its place in one assignment.
    """

    def __init__(self, load: Callable[[str], Dynamics], config: ServingConfig) -> None:
        """Load and serve the model that the settings name.

        Raises:
            SainError: the model is not sound, as `prepare`.
        """
        self._load = load
        self.current = self._make(config)

    def prepare(self, name: str) -> ModelServer:
        """Return a server of another model, loaded and tried; nothing is served differently yet.

        Raises:
            CheckpointError: a checkpoint that is missing, damaged or of another architecture.
            ConfigError: no model of this name.
            ModelUnavailableError: it predicts NaN or Inf.
        """
        return self._make(replace(self.current.config, model=name))

    def serve(self, server: ModelServer) -> None:
        """Serve this from the next request on."""
        self.current = server

    def _make(self, config: ServingConfig) -> ModelServer:
        server = ModelServer(self._load(config.model), config)
        server.try_out()
        return server
