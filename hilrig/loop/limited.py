"""Which limits changed a command: the bits of `limited` in Command.msg and Applied.msg."""

from __future__ import annotations

from enum import IntFlag


class Limited(IntFlag):
    """Why a command was changed, or ended the trial."""

    TORQUE = 1
    TORQUE_RATE = 2
    POSITION = 4
    POSITION_RATE = 8
    NOT_FINITE = 16


WORDS = {
    Limited.TORQUE: "torque", Limited.TORQUE_RATE: "torque rate", Limited.POSITION: "joint position",
    Limited.POSITION_RATE: "joint position rate",
}  # fmt: skip
