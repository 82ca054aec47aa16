"""A driver or controller process that stamps its ticks only in every other block; its argument is the rig's orders.

The loop tests the setting `rig.certificate` once per tick. Here it is a list, which is true while it is not empty: this
test costs the loop no more than testing a bool. See docs/decisions/0022-what-the-certificate-costs.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import cast

from hilrig.rig.child import Child, main

PACKETS = 13
"""Packets to the logger in a block; in lockstep, with 80 ticks in each, a block is 1,040 ticks"""


def alternating(put: Callable[[bytes], None], stamping: list[bool]) -> Callable[[bytes], None]:
    """Return `put` for packets to the logger that also empties or refills `stamping` after every `PACKETS` of them."""
    sent = 0

    def put_and_count(packet: bytes) -> None:
        nonlocal sent
        put(packet)
        sent += 1
        if sent % PACKETS == 0:
            stamping[:] = [] if stamping else [True]

    return put_and_count


def work(child: Child) -> None:
    """Run the role that the orders name, stamping its ticks in every other block."""
    stamping, record = [True], child.record
    child.settings = replace(child.settings, certificate=cast(bool, stamping))
    child.record = lambda: alternating(record(), stamping)
    import_module(f"hilrig.rig.{child.role}_process").work(child)


if __name__ == "__main__":
    main(work)
