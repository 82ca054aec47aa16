"""What a trial's time stamps prove: which ticks were late, through whom, and whether it kept its budget. Pure."""
