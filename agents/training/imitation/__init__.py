"""Imitation learning: behaviour cloning and DAgger.

`trainer` runs the rounds; `dagger_rollouts` flies the learner and asks the expert in every state;
`data_aggregation` collects these states into one dataset (`dataset`); `behavior_cloning` takes the
gradient steps, with mirror images (`mirror`) and a penalty on infeasible segments
(`violation_penalty`); `demonstration_data` replays recorded demonstrations. Only the
hyperparameters, `ImitationOptions`, need no PyTorch and are therefore imported here.
"""

from agents.training.imitation.options import ImitationOptions as ImitationOptions
