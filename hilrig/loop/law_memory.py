"""What of a law's memory is recorded."""

from hilrig.core.law_memory import memory_sizes as memory_sizes
