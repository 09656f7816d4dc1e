"""What files of the RL Zoo write in another way, translated for `hyperparameters.read`.

The RL Zoo (https://rl-baselines3-zoo.readthedocs.io) reads the block of one environment and hands
every key in it to the algorithm, except for those that it knows. What only `ferguson train` knows
therefore stands in a block of its own, `ferguson`, which the Zoo does not read.
"""

from __future__ import annotations

import ast
import warnings
from typing import Any

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.runtime import truncate_repr

OWN_BLOCK = "ferguson"
"""Key at the top whose block only `ferguson train` reads."""
_DEFAULT_BLOCK = "default"
"""Key at the top for every environment that is not listed."""
_POLICIES = {"MlpPolicy": "mlp", "MultiInputPolicy": "mlp"}
"""Policies of Stable-Baselines3 by name; the observation decides which of the two is right."""
_IGNORED = frozenset(
    {
        *("normalize", "frame_stack", "env_wrapper", "vec_env_wrapper", "callback"),
        *("monitor_kwargs", "replay_buffer_class", "replay_buffer_kwargs"),
        *("optimize_memory_usage", "use_sde", "use_sde_at_warmup", "sde_sample_freq"),
        *("noise_type", "noise_std"),
    }
)
"""Keys of the Zoo that `ferguson train` cannot honour."""
_LONGEST = 1000
"""Upper limit on the length of an expression."""


def entries(content: object) -> dict[str, Any]:
    """The keys and values of this environment, the block `ferguson` included.

    Raises:
        ValueError: no block of this environment, a block without keys, or a key in both.
    """
    if not isinstance(content, dict) or not {ENVIRONMENT_ID, _DEFAULT_BLOCK} & set(content):
        raise ValueError(f"need the key {ENVIRONMENT_ID} at the top")
    name = ENVIRONMENT_ID if ENVIRONMENT_ID in content else _DEFAULT_BLOCK
    given, own = _block(content, name), _block(content, OWN_BLOCK)
    if twice := sorted(set(given) & set(own)):
        raise ValueError(f"{', '.join(twice)} stands below {name} and below {OWN_BLOCK}")
    return _translated({**given, **own})


def _block(content: dict[Any, Any], name: str) -> dict[str, Any]:
    block = content.get(name, {})
    if not isinstance(block, dict) or not all(isinstance(key, str) for key in block):
        raise ValueError(f"need keys and values below {name}")
    return block


def _translated(given: dict[str, Any]) -> dict[str, Any]:
    """The same in the words of `ferguson train`; what it cannot honour is named in a warning."""
    found = {key: value for key, value in given.items() if key not in _IGNORED}
    if dropped := sorted(key for key in _IGNORED if not _is_off(given.get(key))):
        warnings.warn(
            f"ignored the RL Zoo's {', '.join(dropped)}: ferguson train has nothing like it",
            stacklevel=4,
        )
    if isinstance(policy := found.get("policy"), str):
        found["policy"] = _POLICIES.get(policy, policy)
    for key in ("policy_kwargs", "env_kwargs"):
        if isinstance(value := found.get(key), str):
            found[key] = _expression(key, value)
    found.setdefault("n_envs", 1)
    return found


def _is_off(value: object) -> bool:
    """Whether a key of the Zoo changes nothing; True equals 1, which is a stack of one frame."""
    return value is None or value is False or (type(value) is int and value in (1, -1))


def _expression(key: str, text: str) -> Any:
    """The value of a Python expression such as `dict(net_arch=[64], activation_fn=nn.ReLU)`.

    Nothing is run: it consists of plain values, `dict(...)`, and classes, which become their names
    in lower case.

    Raises:
        ValueError: anything else.
    """
    try:
        if len(text) > _LONGEST:
            raise ValueError
        return _value(ast.parse(text.strip(), mode="eval").body)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        raise ValueError(
            f"{key} must have keys and values, or be dict(KEY=VALUE, ...), "
            f"got {truncate_repr(text)}"
        ) from None


def _value(node: ast.expr) -> Any:
    if isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name) or node.func.id != "dict" or node.args:
            raise ValueError
        if not all(word.arg for word in node.keywords):
            raise ValueError
        return {word.arg: _value(word.value) for word in node.keywords}
    if isinstance(node, ast.Dict):
        keys = [None if key is None else _value(key) for key in node.keys]
        return dict(zip(keys, map(_value, node.values), strict=True))
    if isinstance(node, ast.List | ast.Tuple):
        return [_value(entry) for entry in node.elts]
    if isinstance(node, ast.Attribute):
        return node.attr.lower()
    return ast.literal_eval(node)
