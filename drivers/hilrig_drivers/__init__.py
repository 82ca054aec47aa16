"""Drivers that come with hilrig: code that speaks to one plant and knows nothing of the bus."""
