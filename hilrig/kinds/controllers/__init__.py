"""Control laws, one kind a file."""
