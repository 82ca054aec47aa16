"""References: one scalar desired quantity over time, a position in m or a force in N."""
