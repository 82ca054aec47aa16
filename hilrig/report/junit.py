"""JUnit XML for CI systems: one test case per trial and per expectation.

There is no standard. The output uses only what the common readers share: testsuites > testsuite > testcase > failure,
as in Jenkins' junit-10.xsd. It has no time stamps, so the same run gives the same file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from hilrig.recording.run_directory import reason_of
from hilrig.report.dataset import RunData, TrialEntry
from hilrig.report.expectations import Expected

_NOT_XML = re.compile("[^\\t\\n\\r\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")
"""Characters that XML 1.0 cannot contain, even escaped; a reason may quote any text"""


def junit_xml(data: RunData, expected: Sequence[Expected]) -> str:
    """Return the run as JUnit XML: one test suite, with a failure for each trial and each expectation that failed.

    A trial that did not complete is not a failure if the experiment expects that. A trial outside its timing budget is.
    """
    name = data.manifest["name"]
    cases = [_trial(name, trial, data.as_expected(trial)) for trial in data.trials] + [
        _expectation(name, item) for item in expected
    ]
    counts = {
        "tests": str(len(cases)), "failures": str(sum(len(case) for case in cases)), "errors": "0", "skipped": "0",
        "time": f"{sum(float(case.get('time', 0)) for case in cases):.3f}",
    }  # fmt: skip
    root = ET.Element("testsuites")
    ET.SubElement(root, "testsuite", {"name": _clean(name), **counts}).extend(cases)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _trial(name: str, trial: TrialEntry, as_expected: bool) -> ET.Element:
    case = _case(f"{name}.trials", trial.id, trial.outcome.get("wall_s", 0.0))
    if not trial.counts and not as_expected:
        outcome = trial.ending
        _fail(case, outcome, f"{outcome}: {reason_of(trial.outcome)}")
    return case


def _expectation(name: str, item: Expected) -> ET.Element:
    case = _case(f"{name}.expect", f"{item.subject}: {item.limit}", 0.0)
    if not item.met:
        _fail(case, "not met", f"expected {item.limit}, got {item.seen} ({item.basis})")
    return case


def _case(group: str, name: str, seconds: float) -> ET.Element:
    return ET.Element("testcase", {"classname": _clean(group), "name": _clean(name), "time": f"{seconds:.3f}"})


def _fail(case: ET.Element, kind: str, message: str) -> None:
    failure = ET.SubElement(case, "failure", {"type": kind, "message": _clean(message)})
    failure.text = _clean(message)


def _clean(text: str) -> str:
    """Return `text` with a replacement character for each one that XML cannot contain."""
    return _NOT_XML.sub("\ufffd", text)
