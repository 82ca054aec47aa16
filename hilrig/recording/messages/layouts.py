"""The channels of a trial and their codecs. A channel has one message per tick, and all have the same size."""

from __future__ import annotations

from collections.abc import Mapping

from hilrig.recording.messages.codec import Codec, Definition, definition, extended

CHANNELS = {
    "state": "State",
    "truth": "Truth",
    "command": "Command",
    "internals": "Internals",
    "applied": "Applied",
    "stages": "Stage",
    "driver_timing": "DriverTiming",
    "controller_timing": "ControllerTiming",
}
"""Channel -> message"""


def definitions(memory: Mapping[str, int]) -> dict[str, Definition]:
    """Return the definition of every channel; `memory` gives the fields of the law's memory (name -> length)."""
    found = {channel: definition(message) for channel, message in CHANNELS.items()}
    return {**found, "internals": extended(found["internals"], memory)}


def layouts(joints: int, axes: int, memory: Mapping[str, int]) -> dict[str, Codec]:
    """Return the codec of every channel for a robot with this many joints and task axes, and a law with this memory."""
    found = definitions(memory)
    per_joint = dict.fromkeys(("joint_position", "joint_velocity", "applied_torque", "torque"), joints)
    commanded = {"torque": joints, "position": joints}
    per_axis = {"position": axes, "velocity": axes, "wrench": 6}
    sizes = {
        "state": {**per_joint, "wrench": 6},
        "truth": {**per_joint, **per_axis},
        "command": {**commanded, "asked": joints},
        "applied": commanded,
        "internals": {field.name: axes for field in found["internals"].fields if field.size == 0},
        "stages": {**commanded, "joint_position": joints, "wrench": 6},
        "driver_timing": {},
        "controller_timing": {},
    }
    return {channel: Codec(found[channel], sizes[channel]) for channel in CHANNELS}
