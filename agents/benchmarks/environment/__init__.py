"""Steps per second of the environment, beside those of Gymnasium's CartPole.

`bench` measures and reports, `drivers` step the environments, `subprocess_envs` runs some of them
in processes, and `startup` times a fresh process.
"""
