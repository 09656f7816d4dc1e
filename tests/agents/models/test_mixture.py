"""Mixtures of Gaussians: densities, samples, modes, and policies that use them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")

import torch
from scipy import stats
from stable_baselines3 import PPO

from agents.models import loading, networks, torch_model
from agents.models.mixture import MAX_STD, MIN_STD, Mixture, MixturePolicy
from agents.models.model_card import ModelCard, write_card
from agents.training.sb3_vec_env import ObstacleFieldVecEnv

COMPONENTS, SIZE = 3, 4
DISCS: dict[str, Any] = {"observation": "discs", "nearest": 4}


def drawn(number: int, seed: int = 0, spread: float = -1.5) -> Any:
    """Mixtures with parameters drawn at random."""
    torch.manual_seed(seed)
    mixture = Mixture(SIZE, COMPONENTS)
    layer, log_std = mixture.proba_distribution_net(5, spread)
    rows = layer(torch.randn(number, 5)).detach() * 2.0
    return mixture.proba_distribution(rows, log_std.detach())


def mixed(weights: list[float], means: list[list[float]], spreads: list[float]) -> Any:
    """A mixture of the given components."""
    mixture = Mixture(len(means[0]), len(weights))
    mixture.log_weights = torch.tensor([weights]).log()
    mixture.means = torch.tensor([means])
    mixture.spreads = torch.tensor(spreads)[None, :, None].expand_as(mixture.means)
    return mixture


def test_the_density_is_that_of_a_mixture() -> None:
    mixture = drawn(20)
    actions = torch.rand(20, SIZE) * 2.0 - 1.0
    found = mixture.log_prob(actions).numpy()
    for i in range(20):
        density = sum(
            np.exp(mixture.log_weights[i, k].item())
            * stats.multivariate_normal(
                mixture.means[i, k].numpy(), np.diag(mixture.spreads[i, k].numpy() ** 2)
            ).pdf(actions[i].numpy())
            for k in range(COMPONENTS)
        )
        assert found[i] == pytest.approx(np.log(density), rel=1e-4, abs=1e-4)


def test_weights_add_up_and_spreads_keep_their_bounds() -> None:
    for spread in (-20.0, -1.5, 20.0):
        mixture = drawn(50, spread=spread)
        np.testing.assert_allclose(mixture.log_weights.exp().sum(dim=1), 1.0, rtol=1e-5)
        assert mixture.spreads.min() >= MIN_STD - 1e-6
        assert mixture.spreads.max() <= MAX_STD
    assert drawn(5, spread=-20.0).spreads.max() == pytest.approx(MIN_STD)


def test_samples_follow_the_density() -> None:
    weights, means, spreads = (
        [0.2, 0.5, 0.3],
        [[-0.8, 0.1], [0.0, 0.5], [0.9, -0.2]],
        [0.05, 0.2, 0.1],
    )
    mixture = mixed(weights, means, spreads)
    number = 40_000
    for name in ("log_weights", "means", "spreads"):
        part = getattr(mixture, name)
        setattr(mixture, name, part.expand(number, *part.shape[1:]))
    torch.manual_seed(1)
    samples = mixture.sample().numpy()
    assert samples.shape == (number, 2)
    share, centre = np.array(weights), np.array(means)
    mean = share @ centre
    variance = share @ (np.array(spreads)[:, None] ** 2 + centre**2) - mean**2
    np.testing.assert_allclose(samples.mean(axis=0), mean, atol=0.015)
    np.testing.assert_allclose(samples.var(axis=0), variance, rtol=0.03)
    nearest = np.linalg.norm(samples[:, None] - centre, axis=2).argmin(axis=1)
    # what is far from the others is told apart with certainty
    assert np.mean(nearest == 0) == pytest.approx(0.2, abs=0.01)


def test_the_mode_is_near_the_heavier_component_and_not_in_between() -> None:
    left, right = [0.2, 0.6, 0.0, 0.3], [0.2, -0.6, 0.0, -0.3]
    for weight, way in ((0.7, left), (0.52, left), (0.48, right), (0.1, right)):
        mode = mixed([weight, 1.0 - weight], [left, right], [0.1, 0.1]).mode()
        np.testing.assert_allclose(mode, [way], atol=1e-5)
    # the density is highest at the narrow component, and yet the way is the heavy one
    mode = mixed([0.4, 0.6], [left, right], [0.02, 0.5]).mode()
    np.testing.assert_allclose(mode, [right], atol=1e-5)


def test_similar_components_count_as_one_mode() -> None:
    near = [[0.20, 0.60], [0.22, 0.58], [0.2, -0.6]]
    (mode,) = mixed([0.3, 0.3, 0.4], near, [0.1, 0.1, 0.1]).mode().numpy()
    np.testing.assert_allclose(mode, [0.21, 0.59], atol=0.005)


def test_modes_and_densities_have_finite_gradients() -> None:
    mixture = Mixture(SIZE, COMPONENTS)
    for scale in (0.0, 1.0, 100.0):
        rows = (scale * torch.randn(30, COMPONENTS * (1 + 2 * SIZE))).requires_grad_()
        mixture.proba_distribution(rows, torch.full((SIZE,), -1.5))
        cost = mixture.mode().square().sum() - mixture.log_prob(torch.zeros(30, SIZE)).sum()
        (gradient,) = torch.autograd.grad(cost, rows)
        assert torch.isfinite(cost)
        assert torch.isfinite(gradient).all()


def card_of(components: int = 3) -> ModelCard:
    kwargs = {"net_arch": [16], "activation_fn": "tanh", "components": components}
    return ModelCard(
        algorithm="ppo",
        policy="deepsets-mixture",
        policy_kwargs=json.loads(json.dumps({**kwargs, "log_std_init": -1.5})),
        environment=DISCS,
    )


def learner(card: ModelCard, seed: int = 0) -> PPO:
    return PPO(
        networks.policy_class(card.algorithm, card.policy),
        ObstacleFieldVecEnv(2, suite="sparse", fields=3, **card.environment),
        n_steps=8,
        batch_size=8,
        n_epochs=1,
        seed=seed,
        device="cpu",
        policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
    )


def observations(number: int = 16) -> dict[str, Any]:
    space = ObstacleFieldVecEnv(1, fields=1, **DISCS).observation_space
    space.seed(0)
    seen = [space.sample() for _ in range(number)]
    return {key: torch.from_numpy(np.stack([one[key] for one in seen])) for key in seen[0]}


def test_policies_are_made_of_json_and_ppo_learns_with_them(tmp_path: Path) -> None:
    card = card_of()
    model = learner(card)
    assert isinstance(model.policy, MixturePolicy)
    assert model.policy.components == 3
    assert model.policy.log_std[0] == -1.5
    before = [weight.clone() for weight in model.policy.parameters()]
    model.learn(32)  # two updates
    after = list(model.policy.parameters())
    assert all(torch.isfinite(weight).all() for weight in after)
    assert any(not torch.equal(a, b) for a, b in zip(before, after, strict=True))

    # another instance takes the weights, from disk or by hand, and thinks the same
    torch_model.save(tmp_path, model, card)
    loaded, other, seen = torch_model.load(tmp_path).policy, learner(card, seed=1), observations()
    other.policy.load_state_dict(model.policy.state_dict())
    model.policy.set_training_mode(False)
    with torch.no_grad():
        expected = model.policy._predict(seen, deterministic=True)
        for policy in (loaded, other.policy):
            policy.set_training_mode(False)
            assert torch.equal(policy._predict(seen, deterministic=True), expected)


def test_the_library_s_own_copy_of_a_policy_is_the_same(tmp_path: Path) -> None:
    policy = learner(card_of(components=5)).policy
    policy.save(str(tmp_path / "policy.pth"))
    again = MixturePolicy.load(str(tmp_path / "policy.pth"))
    assert again.components == 5
    seen = observations()
    with torch.no_grad():
        assert torch.equal(again._predict(seen, True), policy._predict(seen, True))


def test_other_numbers_of_components_are_not_loaded(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the card describes another network"):
        torch_model.save(tmp_path, learner(card_of(3)), card_of(4))
    torch_model.save(tmp_path, learner(card_of(3)), card_of(3))
    write_card(tmp_path, card_of(4))
    with pytest.raises(ValueError, match="its weights are not those of the network"):
        loading.load(tmp_path)


def test_algorithms_that_take_no_mixture_say_so() -> None:
    message = r"tqc takes no policy 'mlp-mixture'; ppo, bc, dagger do, and it takes mlp"
    with pytest.raises(ValueError, match=message):
        networks.policy_class("tqc", "mlp-mixture")


@pytest.mark.parametrize("components", [0, -1, 1.5])
def test_invalid_numbers_of_components_are_refused(components: Any) -> None:
    with pytest.raises(ValueError, match="components must be an integer >= 1, got"):
        torch_model.build(card_of(components))
