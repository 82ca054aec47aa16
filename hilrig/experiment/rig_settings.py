"""What the rig does to keep the loop's period in a real-time trial; one field per measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hilrig.core.parameters import Parameter


@dataclass(frozen=True)
class RigSettings:
    """The real-time set-up of driver and controller: applied where permitted, otherwise reported, never required.

    None of it but `law_memory` is applied in lockstep, which has no deadlines. Reasons and figures: docs/realtime.md.
    """

    pace: Annotated[
        Literal["samples", "timer"],
        Parameter("", "what begins a tick: the plant's samples, if the driver offers to wait for them, or a timer"),
    ] = "samples"
    spin: Annotated[float, Parameter("s", "last part of each wait for a tick, spent busy-waiting", 0.0, 0.01)] = 100e-6
    scheduler: Annotated[
        Literal["fifo", "batch", "other"], Parameter("", "scheduling policy of driver and controller")
    ] = "fifo"
    priority: Annotated[
        int, Parameter("", "priority of the controller with 'fifo'; the driver's is one higher", 1, 98)
    ] = 50
    timer_slack: Annotated[
        float, Parameter("s", "how late the kernel may wake them to merge timers, without 'fifo'", 1e-9, 1e-3)
    ] = 1e-9
    pin: Annotated[bool, Parameter("", "whether driver and controller share one core, and the logger has another")] = (
        True
    )
    lock_memory: Annotated[bool, Parameter("", "whether their memory is locked and their heap preallocated")] = True
    freeze_garbage: Annotated[bool, Parameter("", "whether Python's garbage collector is off during the trial")] = True
    cpu_dma_latency: Annotated[
        float | None,
        Parameter("s", "longest accepted wake-up of an idle core; null: the machine's setting", 0, 1),
    ] = 2e-6
    certificate: Annotated[
        bool, Parameter("", "whether every tick is stamped; without stamps the trial's timing is unknown")
    ] = True
    law_memory: Annotated[
        float | None,
        Parameter(
            "B", "memory that a law may take; a trial whose law asks for more fails; null: no limit", 1e7, 1e13, "log"
        ),
    ] = 2e9
    low_latency_link: Annotated[bool, Parameter("", "whether the bus uses zenoh's low-latency link")] = True
