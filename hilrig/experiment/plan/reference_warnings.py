"""The warnings of an experiment's references, with their place in its file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from hilrig.core.interfaces import Span
from hilrig.experiment.document import Keys
from hilrig.experiment.plan.planning import phase_specs

if TYPE_CHECKING:
    from hilrig.experiment import Experiment


def of_references(experiment: Experiment) -> Iterator[tuple[Keys, str]]:
    """Yield each warning of a reference that offers `warnings`, with the path to it in the experiment."""
    for index, phase in enumerate(phase_specs(experiment)):
        span = Span(phase.start, phase.end, None)
        for name, references in (("position", phase.position), ("force", phase.force)):
            for axis, reference in references.items():
                for text in getattr(reference, "warnings", lambda span: ())(span):
                    yield ("phases", index, name, axis), f"phase '{phase.name}', axis {axis}: {text}"
