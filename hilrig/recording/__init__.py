"""What a run leaves on disk: bags and the run directory around them."""
