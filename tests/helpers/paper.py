"""The study of the paper: its folder, and its kinds that take the paper at its word."""

from __future__ import annotations

from pathlib import Path

from hilrig.kinds.registry import load_kind

PAPER = Path(__file__).parents[2] / "experiments" / "paper"
LawAsPrinted = load_kind("controllers", str(PAPER / "law_as_printed.py"))
RobotAsPrinted = load_kind("robots", str(PAPER / "robot_as_printed.py"))
DriverAsPrinted = load_kind("drivers", str(PAPER / "driver_as_printed.py"))
