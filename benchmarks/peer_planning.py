"""Optimizers of other projects as planners in our loop: same model, costs, feasibility."""

import time
from functools import partial
from typing import Final

import numpy as np

from benchmarks.peer_optimizers import Numbers, PeerOptimizer, PeerSettings, PushBox, peer_optimizer
from sain_core.model import RolloutModel
from sain_core.types import PushSequences, Scalars
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.agent.planning import Decider, FallbackRollout, Patience
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.cost import Objective

FORBIDDEN: Final = 1e6  # cost of a sequence whose first push is not permitted


class PeerDecider(Decider):
    """Plans with an optimizer of another project, from what its last plan leaves."""

    def __init__(
        self, model: RolloutModel, physics: RolloutModel, config: AgentConfig, peer: PeerSettings
    ) -> None:
        """Plan with this model, or else with this physics."""
        self._models, self._config, self._peer = (model, physics), config, peer
        self._box = PushBox(config.feasibility.limits, peer.turn)
        self._session: int | None = None
        self._optimizer: PeerOptimizer | None = None
        self._nominal: Numbers | None = None

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Plan from the job's scene and take the first push.

        Raises:
            NoPushError: no push that moves the mid disk is permitted.
        """
        if job.session != self._session or self._optimizer is None:
            seed = int(generator.integers(2**31))
            self._optimizer = peer_optimizer(self._peer, self._box, seed)
            self._nominal, self._session = None, job.session
        patience = Patience(cancelled=job.cancelled)
        model = FallbackRollout(*self._models, job.history, job.problem.bodies, patience)
        search = self._search(job, model)
        nominal = self._start(search, generator)
        for _ in range(self._peer.rounds):
            nominal = self._optimizer.improve(nominal, partial(self._costs, search))
        self._nominal = nominal
        found = self._sequences(search, nominal[None])[0]
        if not self._peer.cheapest:
            search.settle_on(found)  # where its first push is permitted
        if not len(search.elites.sequences):  # not one sample is permitted
            draw = partial(_uniform, search, generator)
            search.evaluate(search.draw_permitted(draw, self._peer.each, generator))
        plan = search.result()
        return PushDecision(job, plan.push, plan, model.failure)

    def _search(self, job: PlanJob, model: RolloutModel) -> Search:
        planner = self._config.planner
        objective = Objective(job.problem, planner.weights)
        return Search(model, planner, objective, job.refused)

    def _start(self, search: Search, generator: np.random.Generator) -> Numbers:
        """Return the rest of the last nominal, and a rest at its end; or a first one."""
        if self._nominal is not None:
            return np.concatenate([self._nominal[1:], self._box.rest[None]])
        if not self._peer.drawn:
            return np.zeros((self._peer.horizon, len(self._box.rest)))
        draw = partial(_uniform, search, generator)
        sequences = search.draw_permitted(draw, self._peer.each, generator)
        sequences = search.without_idle(sequences)
        return self._box.numbers(sequences[np.argmin(search.evaluate(sequences))])

    def _costs(self, search: Search, numbers: PushSequences) -> Scalars:
        """Return what sequences (K, H, 5) in the box's units cost."""
        costs = search.probe(self._sequences(search, numbers))
        return np.where(np.isfinite(costs), costs, FORBIDDEN)

    def _sequences(self, search: Search, numbers: PushSequences) -> PushSequences:
        """Return the pushes of sequences (K, H, 5); those too short to touch are rests."""
        pushes = self._box.pushes(self._box.bounded(numbers))
        return search.without_idle(pushes)


def _uniform(search: Search, generator: np.random.Generator, count: int) -> PushSequences:
    return search.uniform(generator, count)


class TimedDecider(Decider):
    """Measures another decider: processor time of this process, whatever else the machine does."""

    def __init__(self, decider: Decider) -> None:
        """Measure this one."""
        self._decider = decider
        self.seconds: list[float] = []

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Return its decision."""
        begun = time.process_time()
        decision = self._decider.decide(job, generator)
        self.seconds.append(time.process_time() - begun)
        return decision
