"""The live view of a run in the terminal: a separate process that talks only to the loggers."""
