"""The plug-ins of hilrig, one kind per file; their registry, and the mathematics that they share."""
