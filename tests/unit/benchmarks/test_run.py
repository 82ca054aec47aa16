"""Which measurands there are, and how a run goes through them."""

from __future__ import annotations

from benchmarks.exchange import SCRIPT, TRANSPORTS, Sizes
from benchmarks.measurands import Measurand, Settings, measurands, names
from benchmarks.run import _result, run_rounds
from hilrig.core.errors import RigError


def test_names_and_measurands_agree() -> None:
    everything = measurands(Settings(), Sizes(1, 1), fifo=False)
    groups = {group for item in everything for group in item.groups}
    assert {item.name for item in everything} | groups == set(names())
    assert [item.name for item in measurands(Settings(), Sizes(1, 1), False, ["certificate"])] == [
        "lockstep.alternating",
    ]  # fmt: skip
    assert [item.name for item in measurands(Settings(), Sizes(1, 1), False, ["lcm.paced"])] == ["lcm.paced"]


def test_rounds_turn_about_and_note_what_fails() -> None:
    called: list[str] = []

    def measuring(name: str, fails_at: int = 0) -> Measurand:
        def measure() -> dict[str, float]:
            called.append(name)
            if called.count(name) == fails_at:
                raise RigError("it broke")
            return {"x": float(called.count(name))}

        return Measurand(name, (), name, measure)

    absent = Measurand("c", (), "c", lambda: {"x": 0.0}, lambda: "not installed")
    listed = [measuring("a"), measuring("b", fails_at=2), absent]
    rounds, notes = run_rounds(listed, 3, lambda line: None)
    assert called == ["a", "b", "b", "a", "a", "b"]
    assert [sorted(samples) for samples in rounds] == [["a", "b"], ["a"], ["a", "b"]]
    assert notes == {"b": "failed in repeat 2: it broke", "c": "not installed"}
    assert _result(listed[1], rounds, notes["b"])["quantities"]["x"]["values"] == [1.0, 3.0]


def test_every_transport_has_its_script() -> None:

    assert all(SCRIPT.with_name(f"{transport.script}.py").is_file() for transport in TRANSPORTS)
    assert all(transport.install for transport in TRANSPORTS if transport.module)
