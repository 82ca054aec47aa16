"""The live view of a run in the terminal: a process of its own, which asks the loggers and nobody else."""
