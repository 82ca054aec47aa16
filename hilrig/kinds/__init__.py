"""What plugs into hilrig, one kind a file; their registry, and the mathematics that they share."""
