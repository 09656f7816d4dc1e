"""Forward passes of actor networks as compiled kernels, without torch.

`forward.CompiledNetwork` maps observations to actions; the answer to a row does not depend on the
rows beside it. `features`, `matmul`, `activations` and `heads` are its stages. Nothing is
re-exported here, because `agents.models.weights` and `forward` both build on `activations`.
"""
