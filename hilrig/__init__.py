"""hilrig: hardware-in-the-loop experiments for robot force-position control."""

__version__ = "0.1.0"
