"""Control laws, one kind per file."""
