"""Forward passes of actor networks as compiled kernels, without torch.

`forward.CompiledNetwork` maps observations to actions; the output for one observation does not
depend on the others in the batch. `features`, `matmul`, `activations` and `heads` are its stages.
Nothing is re-exported here, because `agents.models.weights` and `forward` both build on
`activations`.
"""
