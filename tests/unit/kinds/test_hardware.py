"""What a driver of hardware lacks is found without touching the hardware."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import pytest
from helpers.builders import arm, surface
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import Capabilities, Plant, Robot
from hilrig.kinds.hardware import REQUIRED, lacks


class Arm:
    """A plant that has all it needs; none of it may be called."""

    def connected(self, *arguments: object) -> Any:
        raise AssertionError("nobody may touch the arm")

    __init__ = measure = advance = holding_command = truth = hold = close = connected  # type: ignore[assignment]

    def prepare(self) -> Any:
        yield


@dataclass(frozen=True)
class Hardware:
    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=1.0)
    robot: Robot
    servo_gain: ClassVar[None] = None
    surface_position: ClassVar[float] = 0.35

    def connect(self, start: Any) -> Arm:
        return Arm()


def found(**changes: Any) -> list[str]:
    """Return what a driver lacks in which something was changed."""
    kind: Any = type("Changed", (Hardware,), changes)
    return lacks(kind(arm()))


def plant(**changes: Any) -> Any:
    """Return a `connect` that says it returns a plant in which something was changed."""
    kind = type("MyArm", (Arm,), changes)

    def connect(self: Any, start: Any) -> Any:
        raise AssertionError("nobody may connect")

    connect.__annotations__["return"] = kind
    return connect


def test_one_that_has_all_it_needs_lacks_nothing() -> None:
    assert found() == []


def test_a_simulated_plant_needs_none_of_it() -> None:
    assert lacks(TwoLink(arm(), surface())) == []


@pytest.mark.parametrize("name", REQUIRED)
def test_a_method_that_is_missing_is_named(name: str) -> None:
    assert found(connect=plant(**{name: None})) == [f"its plant, MyArm, has no `{name}`"]


def test_it_says_how_long_it_takes_to_stop() -> None:
    (sentence,) = found(capabilities=Hardware.capabilities._replace(stop_time=0.0))
    assert "stop_time is 0 s" in sentence


def test_a_robot_does_not_wait() -> None:
    (sentence,) = found(capabilities=Hardware.capabilities._replace(clocks=("lockstep", "realtime")))
    assert "must be ('realtime',)" in sentence


@pytest.mark.parametrize("told", [None, Plant, "Nothing", "1 +"])
def test_it_says_which_plant_it_returns(told: Any) -> None:
    connect = plant()
    connect.__annotations__ = {} if told is None else {"return": told}
    (sentence,) = found(connect=connect)
    assert "write `def connect(self, start) -> MyPlant:`" in sentence


@pytest.mark.parametrize("stage", ["prepare", "approach", "retract"])
def test_a_stage_that_would_block_is_named(stage: str) -> None:
    def blocks(self: Any) -> list[Any]:
        return []

    (sentence,) = found(connect=plant(**{stage: blocks}))
    assert f"`{stage}` of its plant, MyArm, is no generator" in sentence
