"""What several tests share: builders, simulated loops, runs made by hand."""
