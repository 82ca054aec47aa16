"""Whether the expectations of an experiment fit it, and whether a trial ended as expected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from hilrig.core.errors import nearest
from hilrig.core.quantities import quantity
from hilrig.experiment.model import Expectation, Experiment
from hilrig.experiment.schema import SchemaFinding
from hilrig.experiment.trial import ALL_PHASES
from hilrig.kinds import registry as plugins

OF_A_METRIC = ("minus", "phase", "axis", "below", "above")
"""Keys that apply to a metric, and not to an outcome"""


def ends_as_expected(expect: Iterable[Mapping[str, Any]], controller: str, condition: str, outcome: str) -> bool:
    """Return whether an expectation, as in plan.json, says that such a trial ends with this outcome."""
    return any(
        item.get("outcome") == outcome and item["controller"] == controller
        and item.get("condition") in (None, condition)
        for item in expect
    )  # fmt: skip


def ended_early(as_expected: Iterable[str]) -> str:
    """Return the text after the number of completed trials: how many others ended as expected; "" if none did."""
    counts = Counter(outcome for outcome in as_expected if outcome != "completed")
    return "".join(f", {count} {outcome} as expected" for outcome, count in counts.items())


def check_expectation(experiment: Experiment, expectation: Expectation, index: int) -> Iterator[SchemaFinding]:
    """Yield what is wrong with one expectation: unknown names, and keys that do not go together."""
    controllers = tuple(experiment.controllers)
    choices = {
        "metric": ("metric", plugins.kind_names("metrics")),
        "controller": ("controller", controllers),
        "minus": ("controller", controllers),
        "phase": ("phase", (*(phase.name for phase in experiment.phases), ALL_PHASES)),
        "axis": ("axis", experiment.driver.robot.axes),
        "condition": ("condition", tuple(experiment.conditions)),
    }
    for name, (what, known) in choices.items():
        value = getattr(expectation, name)
        if value is not None and value not in known:
            message = f"there is no {what} '{value}'{nearest(value, known)} (known: {', '.join(known)})"
            yield SchemaFinding(("expect", index, name), message)
    if expectation.minus == expectation.controller:
        others = ", ".join(name for name in controllers if name != expectation.minus) or "none"
        message = f"'{expectation.minus}' minus itself is always zero; name another controller (others: {others})"
        yield SchemaFinding(("expect", index, "minus"), message)
    yield from _check_form(expectation, index)


def _check_form(expectation: Expectation, index: int) -> Iterator[SchemaFinding]:
    """Yield problems in the combination of keys, whatever their values."""
    if expectation.outcome is not None and expectation.metric is not None:
        message = "'metric' and 'outcome' are both given; write an expectation for each"
        yield SchemaFinding(("expect", index, "outcome"), message, on_key=True)
    elif expectation.outcome is not None:
        for name in OF_A_METRIC:
            if getattr(expectation, name) is not None:
                message = f"'{name}' does not go with 'outcome', which applies to whole trials (allowed: condition)"
                yield SchemaFinding(("expect", index, name), message, on_key=True)
    elif expectation.metric is None:
        yield SchemaFinding(
            ("expect", index), "nothing is expected; give 'metric' with 'below' or 'above', or 'outcome'"
        )
    elif expectation.below is None and expectation.above is None:
        yield SchemaFinding(("expect", index), "the metric has no limit; give 'below' or 'above'")


def complete_expectation(expectation: Expectation, index: int, findings: list[SchemaFinding]) -> Expectation:
    """Return the expectation with its phase and limits in the metric's unit; adds problems to `findings`."""
    if expectation.metric not in plugins.kind_names("metrics"):
        return expectation
    unit = plugins.load_kind("metrics", expectation.metric).unit
    expectation = replace(expectation, phase=expectation.phase or ALL_PHASES)
    for name in ("below", "above"):
        value = getattr(expectation, name)
        if value is not None:
            try:
                expectation = replace(expectation, **{name: quantity(value, unit)})
            except ValueError as error:
                findings.append(SchemaFinding(("expect", index, name), str(error)))
    return expectation
