"""An experiment file that is right, to be made wrong, and what `check` says of it.

The mark § in a text stands where the message must point; it is taken out before the file is written.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from hilrig.core.errors import ExperimentError
from hilrig.experiment import load
from hilrig.experiment.plan import plan

GOOD = """\
hilrig: 1
name: broken
question: What is wrong?
period: 1 ms
driver:
  kind: two_link
  robot: {kind: planar_2r, lengths: [0.345 m, 0.2 m], masses: [1.8 kg, 1.1 kg]}
  surface: {position: 0.35 m, stiffness: 800 N/m}
task:
  force_axes: [z]
  impedance: {inertia: [3, 6], damping: [30, 60], stiffness: [250, 0]}
phases:
  - name: first
    duration: 4 s
    position: {kind: sine, amplitude: 0.1 m, frequency: 1 rad/s}
    force: {kind: hold, value: 3.5 N}
conditions:
  noisy: [{kind: sensor_noise, force: 0.05 N}]
controllers:
  pd: {kind: pd}
"""

POSITION = "{kind: sine, amplitude: 0.1 m, frequency: 1 rad/s}"

TABLE = "time,x,gap,nan,back\n0,0,0,0,0\n1,0.1,,nan,2\n2,0,0,0,1\n"


def broken_file(folder: Path, text: str) -> tuple[Path, tuple[int, int] | None]:
    """Write `text` without its mark; return the file, and line and column of the mark."""
    (folder / "curve.csv").write_text(TABLE)
    before, mark, _ = text.partition("§")
    path = folder / "broken.yaml"
    path.write_text(text.replace("§", ""))
    place = (before.count("\n") + 1, len(before) - before.rfind("\n")) if mark else None
    return path, place


def problems_of(path: Path) -> tuple[str, ExperimentError]:
    """Return the message of what `check` would say."""
    with pytest.raises(ExperimentError) as caught:
        plan(load(path))
    return str(caught.value), caught.value
