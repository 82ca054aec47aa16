"""Drivers that come with hilrig: code that talks to one plant and knows nothing about the bus."""
