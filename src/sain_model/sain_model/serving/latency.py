"""How long a service took lately, and how many wait for it. Belongs to one thread."""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np

RECENT: Final = 256  # requests that the percentiles are of


@dataclass
class ServiceRecord:
    """Counts requests from when they are taken to when they are answered."""

    requests: int = 0  # answered so far
    failures: int = 0  # of them, with an error
    queue: int = 0  # taken and not yet answered
    longest_queue: int = 0
    longest: float = 0.0  # [s]
    # of the latest requests [s], waiting included
    latencies: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT))

    def take(self) -> None:
        """Note that a request was taken."""
        self.queue += 1
        self.longest_queue = max(self.longest_queue, self.queue)

    def answer(self, latency: float, well: bool) -> None:
        """Note that one was answered, so long after it was taken [s]."""
        self.queue -= 1
        self.requests += 1
        self.failures += not well
        self.longest = max(self.longest, latency)
        self.latencies.append(latency)

    def percentile(self, share: float) -> float:
        """Return the latency [s] that a share of the latest requests stayed within; 0: none yet."""
        if not self.latencies:
            return 0.0
        return float(np.quantile(self.latencies, share, method="inverted_cdf"))

    def summary(self) -> dict[str, object]:
        """Return the figures for a report."""
        return {
            "requests": self.requests,
            "failures": self.failures,
            "queue": self.queue,
            "longest_queue": self.longest_queue,
            "last_ms": f"{1e3 * (self.latencies[-1] if self.latencies else 0.0):.1f}",
            "p50_ms": f"{1e3 * self.percentile(0.5):.1f}",
            "p95_ms": f"{1e3 * self.percentile(0.95):.1f}",
            "longest_ms": f"{1e3 * self.longest:.1f}",
        }
