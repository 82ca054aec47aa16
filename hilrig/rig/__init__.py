"""The rig: runs the trials of a plan, in processes on a bus or in one process, and watches them."""
