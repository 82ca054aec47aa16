"""Whether this machine can run the loop at 1 ms: what is known of the host, what a probe measures, and a verdict."""
