"""The live view: made from packets as they come, true to closed forms, and sent to none but those who ask."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.builders import PERIOD, trial

from hilrig.recording.messages.codec import Codec, definition
from hilrig.recording.messages.layouts import definitions
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig import view_maker
from hilrig.rig.view import ASKING, CHANNEL, WATCHER, View, read_view
from hilrig.rig.view_maker import ViewMaker, Views

MEMORY = {"gains": 3}
RATE = 5.0
"""rad/s of the motion"""
TASK = trial().task


def document(**changes: Any) -> dict[str, Any]:
    return {**trial().to_document(), **changes}


def motion(time: np.ndarray) -> dict[str, np.ndarray]:
    """Return a motion in closed form: x and z as sines, a force that grows, references beside them."""
    s, c = np.sin(RATE * time), np.cos(RATE * time)
    both = np.ones(2)
    return {
        "position": 0.1 * np.outer(s, both), "velocity": 0.1 * RATE * np.outer(c, both),
        "acceleration": -0.1 * RATE**2 * np.outer(s, both), "force": np.outer(3.0 + time, [0.1, 1.0]),
        "reference_position": np.outer(0.11 * s, [1, 0]), "reference_velocity": np.outer(0.11 * RATE * c, [1, 0]),
        "reference_acceleration": np.outer(-0.11 * RATE**2 * s, [1, 0]),
        "reference_force": np.outer(3.5 * np.ones_like(time), [0, 1]),
    }  # fmt: skip


def missing(at: dict[str, np.ndarray]) -> np.ndarray:
    """Return eq. (25) on the axes x (position) and z (force), written out."""
    (m_x, m_z), (b_x, b_z), k = TASK.inertia, TASK.damping, TASK.stiffness[0]
    x, rate, acceleration, force = (at[name] for name in ("position", "velocity", "acceleration", "force"))
    e, e_rate, e_acceleration = (
        at[name][:, 0] - at[f"reference_{name}"][:, 0] for name in ("position", "velocity", "acceleration")
    )
    along = m_x * e_acceleration + b_x * e_rate + k * e + force[:, 0]
    pressing = m_z * acceleration[:, 1] + b_z * rate[:, 1] + force[:, 1] - at["reference_force"][:, 1]
    assert x.shape == force.shape
    return np.stack([along, pressing], axis=1)


def payloads(name: str, ticks: np.ndarray, offset: float = 0.0) -> np.ndarray:
    """Return the messages of a channel for these ticks; `offset` is added to all measured forces."""
    time = ticks * PERIOD
    at = motion(time)
    if name == "internals":
        form = definitions(MEMORY)["internals"]
        codec = Codec(form, {field.name: 2 for field in form.fields if field.size == 0})
        at = {**at, "force": at["force"] + offset, "gains": np.ones((ticks.size, 3))}
    else:
        codec = Codec(definition("Truth"), {f.name: 2 for f in definition("Truth").fields} | {"wrench": 6})
        wrench = np.zeros((ticks.size, 6))
        wrench[:, [0, 2]] = at["force"]
        joint = np.zeros((ticks.size, 2))
        at = {**at, "wrench": wrench, "joint_position": joint, "joint_velocity": joint, "surface_position": time}
    columns = {"tick": ticks, "time": time, **at}
    batch = RecordBatch(codec, ticks.size)
    for field, values in zip(codec.definition.fields, batch.fields, strict=True):
        values[:] = columns[field.name]
    return batch.payloads


def made(maker: ViewMaker) -> View:
    payload = maker.view()
    assert payload is not None
    return read_view(payload, 2)


def assert_is_of(view: View, ticks: np.ndarray) -> None:
    """Check the view against the closed form: newest values, largest error, RMS of eq. (25)."""
    at = motion(ticks * PERIOD)
    assert view.tick == ticks[-1]
    assert view.time == pytest.approx(ticks[-1] * PERIOD)
    for name in ("position", "velocity", "force", "reference_position", "reference_force"):
        np.testing.assert_allclose(getattr(view, name), at[name][-1], atol=1e-12, err_msg=name)
    error = np.stack([(at["reference_position"] - at["position"])[:, 0],
                      (at["reference_force"] - at["force"])[:, 1]], axis=1)  # fmt: skip
    for i in range(2):
        assert view.error[i] == pytest.approx(error[np.argmax(np.abs(error[:, i])), i])
    expected = np.sqrt(np.mean(missing(at) ** 2, axis=0))
    # The difference at the two ends of a packet is of first order in the period.
    np.testing.assert_allclose(view.auxiliary_error, expected, rtol=2e-3)


def test_a_view_is_true_to_the_motion_however_the_packets_come() -> None:
    maker, ticks = ViewMaker(document()), np.arange(96)
    maker.note("internals", payloads("internals", ticks[:32], offset=9.0))
    assert maker.view() is None, "the driver has not been heard of"
    maker.note("truth", payloads("truth", ticks[:64]))
    assert_is_of(made(maker), ticks[:32])
    assert maker.view() is None, "nothing new on both sides"
    # Real time: the controller has missed ticks.
    answered = np.array([32, 33, 34, 37, 38, 60, 61, 63])
    maker.note("internals", payloads("internals", answered, offset=9.0))
    view = made(maker)
    assert view.tick == 63
    np.testing.assert_allclose(view.force, motion(np.array([0.063]))["force"][0])
    maker.note("internals", payloads("internals", ticks[64:], offset=9.0))
    maker.note("truth", payloads("truth", ticks[64:]))
    assert_is_of(made(maker), ticks[64:])


def test_a_plant_that_knows_no_truth_is_shown_as_measured() -> None:
    maker, ticks = ViewMaker(document()), np.arange(32)
    maker.note("internals", payloads("internals", ticks))
    assert maker.view() is None
    maker.note("state", np.zeros((32, 8), np.uint8))
    assert_is_of(made(maker), ticks)


def test_one_tick_makes_no_view() -> None:
    maker = ViewMaker(document())
    for name in ("truth", "internals"):
        maker.note(name, payloads(name, np.arange(1)))
    assert maker.view() is None
    for name in ("truth", "internals"):
        maker.note(name, payloads(name, np.arange(1, 32)))
    assert_is_of(made(maker), np.arange(32))


def test_what_nobody_asked_for_is_let_go() -> None:
    maker = ViewMaker(document())
    for name in ("truth", "internals"):
        maker.note(name, payloads(name, np.arange(32)))
    maker.skip()
    assert maker.view() is None


def test_late_ticks_are_counted_in_real_time_alone() -> None:
    """Of four ticks one had an old command and one was applied a period late; the latest wake-up is 2 ms after due."""
    ticks, due = np.arange(4), 7_000_000_000 + 1_000_000 * np.arange(4)
    stamps = {
        "due": due, "woke": due + np.array([0, 2_000_000, 0, 0]), "command": np.array([-1, 0, 0, 2]), "applied": due
        + np.array([0, 0, 0, 1_000_000]), "published": due, "received": due, "continued": 0 * due,
        "sampled": 0 * due, "fresh": 1 + 0 * due,
    }  # fmt: skip
    for clock, late, lateness in (("realtime", 2, 2e-3), ("lockstep", 0, 0.0)):
        maker = ViewMaker(document(clock=clock))
        maker.note("driver_timing", timing_payloads(ticks, stamps))
        for name in ("truth", "internals"):
            maker.note(name, payloads(name, ticks))
        view = made(maker)
        assert (view.late, view.timed, view.lateness) == (late, 4, lateness)


def timing_payloads(ticks: np.ndarray, stamps: dict[str, np.ndarray]) -> np.ndarray:
    form = definition("DriverTiming")
    batch = RecordBatch(Codec(form, {}), ticks.size)
    for field, values in zip(form.fields, batch.fields, strict=True):
        values[:] = {"tick": ticks, "time": ticks * PERIOD, **stamps}[field.name]
    return batch.payloads


class Key:
    """A bus of one participant: keeps what is sent, and asks when told to."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.asked = False
        self.put = self.sent.append

    def outbox(self, channel: str, *, blocking: bool) -> Key:
        assert (channel, blocking) == (CHANNEL, False)
        return self

    def tick_inbox(self, channel: str) -> Key:
        assert channel == ASKING
        return self

    def lead(self, channel: str, sender: str) -> bytes:
        assert (channel, sender) == (ASKING, WATCHER)
        return b"lead"

    def poll(self) -> bytes | None:
        asked, self.asked = self.asked, False
        return b"lead?" if asked else None


def packet(first: int) -> dict[str, np.ndarray]:
    ticks = np.arange(first, first + 32)
    return {name: payloads(name, ticks) for name in ("truth", "internals")}


def test_views_go_out_only_as_long_as_someone_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(view_maker.time, "monotonic", lambda: now)
    key = Key()
    views = Views(key, document())  # pyright: ignore[reportArgumentType]
    sent = []
    for step in range(400):  # 4 s, a packet every 10 ms; asked at 1 s, for the last time
        now, key.asked = 100.0 + step * 0.01, step == 100
        views.note(packet(32 * step))
        sent.append(len(key.sent))
    assert sent[99] == 0
    assert 15 <= sent[200] <= 21
    assert sent[-1] <= 21, "a watcher that asks no more is sent no more than a second's views"


def test_a_fault_in_a_view_does_not_cost_the_record(capsys: pytest.CaptureFixture[str]) -> None:
    key = Key()
    key.asked = True
    views = Views(key, document())  # pyright: ignore[reportArgumentType]
    views.note(dict.fromkeys(("truth", "internals"), np.zeros((2, 5), np.uint8)))
    views.note(packet(0))
    assert key.sent == []
    assert "the live view stops here; recording continues" in capsys.readouterr().out
