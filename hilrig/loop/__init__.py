"""One tick, written once: measure, observe, control, limit, advance; interpreted or compiled."""
