"""What agents and commands build on: terminal output, interrupts, processes, files, provenance.

`executors` spreads calls over worker processes or a Dask cluster, `chunk_store` keeps finished
chunks of work for resuming, and `interrupts` defers Ctrl-C to a point where the program can stop
safely. Nothing is re-exported here, because the command line starts faster when it imports only
what it uses.
"""
