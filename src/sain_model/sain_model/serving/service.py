"""The model that is served, the one that replaces it, and how requests fare."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

from sain_core.config import Config, option
from sain_core.errors import BusyError, ConfigError
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.world import unknown_names
from sain_model.compute.kernel_store import compile_kernels, describe_progress
from sain_model.network.settings import AUTO, DEVICES

if TYPE_CHECKING:
    from sain_model.serving.server import Description, ModelServer


@dataclass(frozen=True)
class ServingConfig(Config):
    """What is served."""

    model: str = option(
        "sain", "name in the registry of models, or the path of a checkpoint", live=True
    )
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    unknown: str = option("", "quantities that scenes give as nominal, separated by commas: mass")
    device: str = option(
        AUTO, "device of the network; auto: a GPU if there is one", choices=DEVICES
    )
    max_work: int = option(
        2_000_000, "largest samples x horizon x disks of a request", minimum=1, maximum=2**40
    )
    max_disks: int = option(32, "largest number of disks of a scene", minimum=2, maximum=1024)
    max_queue: int = option(
        1000, "largest number of waiting requests; others are refused", minimum=1
    )
    state_file: str = option(
        "", "file that keeps the name of the model, to resume after a crash; empty: none"
    )
    service_introspection: str = option(
        "disabled",
        "published service events: none, metadata, or requests and replies too",
        choices=("disabled", "metadata", "contents"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown_names(self.unknown)


LONGEST_PATH: Final = 4096  # characters, as Linux has it
SERVING: Final = "serving"


@dataclass
class ServiceRecord:
    """Counts requests from when they are taken to when they are answered. Of one thread."""

    most: int  # that may wait
    requests: int = 0  # answered so far
    failures: int = 0  # of them, with an error
    refusal: str = ""  # of the latest request; empty: it was answered
    queue: int = 0  # taken and not yet answered
    latest: float = 0.0  # from taking to answering [s]
    longest: float = 0.0  # likewise

    def take(self) -> None:
        """Note that a request was taken; raises `BusyError`: too many are waiting."""
        waiting = self.queue
        self.queue += 1
        if waiting >= self.most:
            raise BusyError(f"{waiting} requests are waiting already; at most {self.most} may")

    def answered(self, taken: float, refusal: str = "") -> None:
        """Note that a request that was taken then was answered, or why it was refused."""
        self.latest = perf_counter() - taken
        self.longest = max(self.longest, self.latest)
        self.queue -= 1
        self.requests += 1
        self.failures += bool(refusal)
        self.refusal = refusal


class ModelService:
    """One model at a time, which another one replaces in one assignment.

    `start` and `prepare` run on threads that may wait, `compute` on the one for predictions; all
    else belongs to the node's.
    """

    server: "ModelServer"

    def __init__(self, config: ServingConfig) -> None:
        self.config = config
        self.record = ServiceRecord(config.max_queue)
        self.bodies: Bodies = PAPER_DISKS  # of the episode
        self.doing = f"loading {config.model}"  # what is done; `SERVING`: requests are answered
        self.prepared: ModelServer | None = None  # waits for `swap`

    def start(self) -> None:
        """Compile kernels, and load the first model.

        Raises:
            CheckpointError, ConfigError, ModelUnavailableError: see `server.load_server`.
        """
        loading = self.doing

        def report(finished: int, total: int) -> None:
            self.doing = describe_progress(finished, total)

        compile_kernels(report)
        self.doing = loading
        # PyTorch takes a second to load: a mistake in the parameters is reported before.
        from sain_model.serving.server import load_server

        self.server = load_server(self.config)
        self.doing = SERVING

    # --- replacing the model ----------------------------------------------------------------------

    def prepare(self, name: str) -> "ModelServer":
        """Return a server of the model of this name, loaded and tried; see `ModelServer`."""
        if len(name) > LONGEST_PATH:
            raise ConfigError(f"the model has {len(name)} characters; allowed: {LONGEST_PATH}")
        return self.server.with_model(name, self.bodies)

    def swap(self) -> bool:
        """Go on with what was prepared; return whether there is any."""
        if self.prepared is None:
            return False
        self.server, self.prepared = self.prepared, None
        return True

    @property
    def description(self) -> "Description":
        """What is served now."""
        return self.server.description

    # --- requests ---------------------------------------------------------------------------------

    def compute(self, work: Callable[["ModelServer"], None], response: Any) -> None:
        """Answer with the model that is served now, whatever is served when it is done."""
        begun, server = perf_counter(), self.server
        response.model = server.description.model
        response.model_hash = server.description.model_hash
        try:
            work(server)
        finally:
            response.compute_time = perf_counter() - begun

    def describe(self, response: Any) -> None:
        """Fill in what the model says of itself, and what is accepted."""
        for name, value in asdict(self.description).items():
            setattr(response, name, value)
        response.max_work, response.max_disks = self.config.max_work, self.config.max_disks

    def figures(self) -> dict[str, object]:
        """Return the figures for a report."""
        described = self.description
        return {
            "model": described.model,
            "model_hash": described.model_hash[:16],
            "device": described.device,
            "requests": self.record.requests,
            "failures": self.record.failures,
            "queue": self.record.queue,
            "last_ms": f"{1e3 * self.record.latest:.1f}",
            "longest_ms": f"{1e3 * self.record.longest:.1f}",
        }
