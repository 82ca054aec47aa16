"""Whether this machine can run the loop at 1 ms: what the host is like, what a probe measures, and a verdict."""
