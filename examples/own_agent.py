"""A custom agent: a policy class, and PPO with a custom reward.

Run it from a checkout with the extra `agents` installed; it trains for half a minute:

    .venv/bin/python examples/own_agent.py
    .venv/bin/python examples/own_agent.py --steps 500_000 --seed 1 --out results/longer

It shows two ways to evaluate a custom policy:

- `Homing` is a class with `begin` and `act`, which is all that a policy needs. It can wrap a
  network of any library, with any observation computed from the field.
- `Keeping` gives the vector environment another reward, with which Stable-Baselines3 trains. The
  model is saved with a card that describes the network and its observation; its path is then the
  name of a policy, here and for `ferguson evaluate`, as the last printed line shows.

All fly field by field in the environment, like every policy, and are compared by SPL: the mean of
success x shortest path / length flown. So short a training only shows that learning works;
docs/learnability.md and docs/agents.md describe better trainings.
"""

import argparse
from pathlib import Path

import numpy as np

try:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnvWrapper
except ImportError as error:
    install = ".venv/bin/pip install --editable '.[agents]' --constraint constraints.txt"
    raise SystemExit(f"own_agent.py needs {error.name}: {install}") from None

from agents.flights import fly
from agents.models import ModelCard, networks, torch_model
from agents.policies import Policy, make_policy
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.world import Field, encode, get_fields
from ferguson_gym.world import transition as flight

SEEN = {"suite": "sparse", "observation": "rays", "rays": 64, "view": 30.0}
NETWORK = {"net_arch": [64, 64], "log_std_init": -1.5}  # small actions: most large ones are refused
LEARNER = {"n_steps": 64, "batch_size": 512, "n_epochs": 8, "learning_rate": 1e-3}
LEARNER |= {"gamma": 0.9, "gae_lambda": 0.9}  # a collision is the fault of the last segment or two


class Homing:
    """Flies straight at the goal, whatever stands in the way."""

    def begin(self, field: Field, seed: int) -> None:
        """A flight begins; whatever is drawn at random is drawn from the seed."""
        self.goal = field.goal

    def act(self, observation: dict[str, np.ndarray], vehicle: flight.State) -> np.ndarray:
        """The next action (4,): here of a segment; a network would look at the observation."""
        way = self.goal - vehicle.position
        step = way * min(1.0, 9.0 / np.linalg.norm(way))
        segment = [vehicle.position, vehicle.position + step, vehicle.derivative, step]
        return encode(segment, vehicle.position, vehicle.derivative)


class Keeping(VecEnvWrapper):
    """The environment's reward, less a price for segments that end near an obstacle."""

    def reset(self) -> dict[str, np.ndarray]:
        """Start all flights."""
        return self.venv.reset()

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict]]:
        """Fly one segment in each; a flight that ended sees the next one's start, far from all."""
        observations, rewards, dones, infos = self.venv.step_wait()
        nearest = SEEN["view"] * observations["rays"].min(axis=1)
        return observations, rewards - 0.03 * np.maximum(0.0, 3.0 - nearest), dones, infos


def train(steps: int, seed: int, directory: Path) -> None:
    """Train for so many segments and save the model with the card that says what it is."""
    model = PPO(
        networks.policy_class("ppo", "mlp"),
        Keeping(ObstacleFieldVecEnv(64, **SEEN)),
        policy_kwargs=networks.sb3_policy_kwargs("mlp", NETWORK),
        seed=seed,
        device="cpu",
        **LEARNER,
    )
    if steps:
        model.learn(steps)
    card = ModelCard(
        algorithm="ppo",
        policy="mlp",
        policy_kwargs=NETWORK,
        environment=SEEN,
        seed=seed,
        settings=LEARNER,
    )
    directory.mkdir(parents=True, exist_ok=True)
    torch_model.save(directory, model, card)


def tell(name: str, policy: Policy, fields: list[Field]) -> float:
    """Fly all fields and print a line of them; the SPL."""
    flights = [fly(policy, field, seed=0, name=name) for field in fields]
    arrived = sum(flight.success for flight in flights)
    spl = float(np.mean([flight.path_share for flight in flights]))
    print(f"{name:16}{arrived:4}/{len(flights)}   SPL {spl:.3f}", flush=True)
    return spl


def main(steps: int, seed: int, fields: str, out: Path) -> None:
    """Fly a policy that is a class, a network before its training, and after it."""
    chosen = list(get_fields(fields))
    print(f"{fields}: arrived, SPL")
    tell("homing", Homing(), chosen)
    for name, number in (("untrained", 0), ("own-agent", steps)):
        train(number, seed, out / name)
        tell(name, make_policy(str(out / name)), chosen)
    print(
        "beside others:\n    .venv/bin/ferguson evaluate "
        f"--policy {out / name} --policy guided --fields {fields} --out {out / 'compared'} --fresh"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", type=int, default=200_000, help="segments to train for")
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--fields", default="sparse/validation:0-99")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    main(**vars(parser.parse_args()))
