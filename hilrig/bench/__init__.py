"""What the rig costs, and how well it sees itself: measured on this machine."""
