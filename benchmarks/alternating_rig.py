"""hilrig with stamps in every other block of ticks: python -m benchmarks.alternating_rig, with hilrig's arguments.

It starts `alternating_process` where hilrig starts the process of the driver or of the controller; all else is hilrig.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from typing import Any

from hilrig.cli import main

STAND_IN = "benchmarks.alternating_process"
REPLACED = {f"hilrig.rig.{role}_process": STAND_IN for role in ("driver", "controller")}


class Popen(subprocess.Popen[Any]):
    """Starts the stand-in for a module that is to be replaced, and any other command as it is."""

    def __init__(self, args: Sequence[str], *more: Any, **options: Any) -> None:
        super().__init__([REPLACED.get(word, word) for word in args], *more, **options)


if __name__ == "__main__":
    subprocess.Popen = Popen
    main()
