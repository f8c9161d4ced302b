"""A policy of one's own: a mixture density network that clones our agent's pushes.

./env --with train python examples/my_policy/my_policy.py 1000 4000      # episodes, steps
PYTHONPATH=examples/my_policy ./env --with train ros2 run sain_eval evaluate \
    --controllers policy:my_policy:load,sain --tolerances 0.02 --scenes 40 --out results/policy
"""

import sys
from hashlib import sha256
from pathlib import Path

import numpy as np
import torch
from joblib import Parallel, delayed
from torch import nn

from sain_core.policy import GOAL, STATE, Observation, Policy, observe

WEIGHTS = Path("runs/my_policy.pt")
FIRST = 1_000_000  # scene; evaluations begin with scene 0
PART = 20  # episodes of a process at a time
SCENARIO = "anywhere"
MODES = 8  # pushes that may be as good as each other
SIZE = 5  # cosine and sine of the location, angle, length, speed
BATCH = 256
MOST = torch.tensor([torch.pi / 4, 0.15, 0.5])  # angle [rad], length [m], speed [m/s]
LEAST = torch.tensor([-torch.pi / 4, 0.0, 0.01])
SMALLEST = -3.0  # logarithm of a standard deviation: less is learned by heart


def demonstrate(first: int, count: int) -> list[tuple[np.ndarray, ...]]:
    """Return what our agent saw and did in episodes that reached the goal."""
    import gymnasium

    from sain_gym import AgentPolicy

    env = gymnasium.make("sain/Push-v0", scenario=SCENARIO)
    world, agent, kept = env.unwrapped, AgentPolicy(env), []
    for seed in range(first, first + count):
        _, info = env.reset(seed=seed)
        rows, over = [], False
        while not over:
            record = world.episode.record
            seen, push = observe(world.scene, record.goal, record.bodies), agent()
            _, _, terminated, truncated, info = env.step(push)
            over = terminated or truncated
            rows += [] if info["refusal"] else [(seen[STATE], seen[GOAL], push)]
        kept += rows if info["is_success"] else []
    return kept


def features(states: torch.Tensor, goals: torch.Tensor) -> torch.Tensor:
    """Return inputs (B, 12) of observations (B, 16) and (B, 10): places, ways and radii."""
    bodies, place = states.reshape(-1, 2, 8), goals.reshape(-1, 2, 5)[:, 1, 1:3]
    mid, target = bodies[:, 0, :2], bodies[:, 1, :2]
    return torch.cat([mid, target, place, target - mid, place - target, bodies[..., 7]], dim=1)


class Network(nn.Module):
    """The density of pushes, as a mixture of normal distributions."""

    def __init__(self) -> None:
        super().__init__()
        inner = [layer for _ in range(2) for layer in (nn.Linear(256, 256), nn.SiLU())]
        outputs = MODES * (1 + 2 * SIZE)
        self.layers = nn.Sequential(
            nn.BatchNorm1d(12), nn.Linear(12, 256), nn.SiLU(), *inner, nn.Linear(256, outputs)
        )

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return logarithms of weights (B, K), means and deviations (B, K, 5)."""
        weights, rest = self.layers(inputs).split([MODES, 2 * MODES * SIZE], dim=1)
        means, deviations = rest.reshape(-1, MODES, 2 * SIZE).chunk(2, dim=2)
        return weights.log_softmax(1), means, deviations.clamp(SMALLEST, 2.0)


def encode(pushes: torch.Tensor) -> torch.Tensor:
    """Return pushes (B, 5) as numbers (B, 5) about from -1 to 1, without a jump at pi."""
    location, rest = pushes[:, 1:2], pushes[:, 2:]
    numbers = 2 * (rest - LEAST) / (MOST - LEAST) - 1
    return torch.cat([location.cos(), location.sin(), numbers], dim=1)


def train(steps: int, states: torch.Tensor, goals: torch.Tensor, pushes: torch.Tensor) -> Network:
    """Return a network that makes the pushes likely, after so many steps."""
    network, wanted, inputs = Network(), encode(pushes), features(states, goals)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for step in range(steps):
        rows = torch.randint(len(inputs), (BATCH,))
        weights, means, deviations = network(inputs[rows])
        off = (wanted[rows, None] - means) / deviations.exp()
        loss = -(weights - (off**2 / 2 + deviations).sum(2)).logsumexp(1).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 500 == 0:
            print(f"step {step} of {steps}, loss {loss.item():.2f}", flush=True)
    return network.eval()


class Cloned(Policy):
    """Makes the most likely push; asked again about the same scene, the next one."""

    features = {STATE: (16,), GOAL: (10,)}  # noqa: RUF012

    def __init__(self, network: Network, version: str) -> None:
        self.network, self.version, self.seen, self.asked = network, version, np.zeros(0), 0

    def select_action(self, observation: Observation) -> np.ndarray:
        """Return the mean of one mode."""
        again = np.array_equal(observation[STATE], self.seen)
        self.seen, self.asked = observation[STATE], self.asked + 1 if again else 0
        seen = (torch.tensor(observation[key][None], dtype=torch.float32) for key in (STATE, GOAL))
        with torch.inference_mode():
            weights, means, _ = self.network(features(*seen))
        mode = weights[0].argsort(descending=True)[self.asked % MODES]
        cosine, sine, *rest = means[0, mode]
        scaled = LEAST + (torch.stack(rest).clamp(-1, 1) + 1) / 2 * (MOST - LEAST)
        return np.array([0.0, torch.atan2(sine, cosine), *scaled], dtype=np.float32)


def load(name: str) -> Policy:
    """Return the policy that was trained last."""
    network = Network()
    network.load_state_dict(torch.load(WEIGHTS, weights_only=True))
    return Cloned(network.eval(), sha256(WEIGHTS.read_bytes()).hexdigest())


if __name__ == "__main__":
    torch.manual_seed(0)
    count, steps = map(int, sys.argv[1:])
    parts = ((FIRST + at, min(PART, count - at)) for at in range(0, count, PART))
    done = Parallel(n_jobs=-1)(delayed(demonstrate)(*part) for part in parts)
    rows = [row for rows in done for row in rows]
    print(f"{len(rows)} pushes of {count} episodes")
    columns = (torch.tensor(np.array(one), dtype=torch.float32) for one in zip(*rows, strict=True))
    WEIGHTS.parent.mkdir(exist_ok=True)
    torch.save(train(steps, *columns).state_dict(), WEIGHTS)
    print(f"wrote {WEIGHTS}")
