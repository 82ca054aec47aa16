"""hilrig with stamps in every other block of ticks: python -m benchmarks.alternating_rig, with hilrig's arguments.

It starts `alternating_process` where hilrig starts the driver or controller process; everything else is hilrig.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from typing import Any

from hilrig.cli import main

STAND_IN = "benchmarks.alternating_process"
REPLACED = {f"hilrig.rig.{role}_process": STAND_IN for role in ("driver", "controller")}


class Popen(subprocess.Popen[Any]):
    """Starts the stand-in for a replaced module, and any other command unchanged."""

    def __init__(self, args: Sequence[str], *more: Any, **options: Any) -> None:
        super().__init__([REPLACED.get(word, word) for word in args], *more, **options)


if __name__ == "__main__":
    subprocess.Popen = Popen
    main()
