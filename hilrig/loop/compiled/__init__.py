"""Trials that are compiled as a whole, for `--in-process`."""
