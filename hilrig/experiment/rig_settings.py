"""What the rig does so that the loop of a trial in real time keeps its period; one field for each measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hilrig.core.parameters import Parameter


@dataclass(frozen=True)
class RigSettings:
    """The real-time set-up of driver and controller: applied where permitted, reported where not, never demanded.

    In lockstep nothing is due, and none of it is applied. Reasons and figures: docs/realtime.md.
    """

    spin: Annotated[float, Parameter("s", "last part of each wait for a tick that is spent awake", 0.0, 0.01)] = 100e-6
    scheduler: Annotated[
        Literal["fifo", "batch", "other"], Parameter("", "scheduling policy of driver and controller")
    ] = "fifo"
    priority: Annotated[
        int, Parameter("", "priority of the controller with 'fifo'; the driver has one more", 1, 98)
    ] = 50
    timer_slack: Annotated[
        float, Parameter("s", "how late the kernel may wake them to save a timer, without 'fifo'", 1e-9, 1e-3)
    ] = 1e-9
    pin: Annotated[bool, Parameter("", "whether driver and controller are kept on one core, the logger on another")] = (
        True
    )
    lock_memory: Annotated[bool, Parameter("", "whether their memory is locked and their heap made beforehand")] = True
    freeze_garbage: Annotated[bool, Parameter("", "whether Python's garbage collector rests during the trial")] = True
    cpu_dma_latency: Annotated[
        float | None,
        Parameter("s", "longest wake-up of an idle core that is accepted; null: as the machine has it", 0, 1),
    ] = 2e-6
    certificate: Annotated[
        bool, Parameter("", "whether every tick is stamped; without, nothing is known of the trial's timing")
    ] = True
    low_latency_link: Annotated[bool, Parameter("", "whether the bus uses zenoh's low-latency link")] = True
