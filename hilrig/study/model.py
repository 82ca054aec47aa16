"""What a reproduction file says, as frozen dataclasses; hilrig.experiment.schema reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hilrig.core.parameters import Parameter
from hilrig.experiment.schema import Later
from hilrig.experiment.trial import ALL_PHASES


@dataclass(frozen=True)
class FigureSpec:
    """One figure: one quantity over time, of one or several controllers, one panel."""

    figure: Annotated[str, Parameter("", "number in the publication")]
    title: Annotated[str, Parameter("", "title")]
    experiment: Annotated[str, Parameter("", "name of an experiment")]
    condition: Annotated[str, Parameter("", "name of a condition")]
    controllers: Annotated[tuple[str, ...], Parameter("", "names of the controllers drawn")]
    quantity: Annotated[str, Parameter("", "what is drawn, or memory.<field> of the law's memory")]
    axis: Annotated[str | None, Parameter("", "axis, or number of a component from 1; default: all of them")] = None
    zoom: Annotated[tuple[float, float] | None, Parameter("s", "span that a second panel enlarges", 0.0, 1e5)] = None
    caption: Annotated[str, Parameter("", "what there is to say about it")] = ""


@dataclass(frozen=True)
class LessThan:
    """Another measured value, times a factor; what is not named is as in the part."""

    controller: Annotated[str | None, Parameter("", "name of the other controller")] = None
    experiment: Annotated[str | None, Parameter("", "name of the other experiment")] = None
    condition: Annotated[str | None, Parameter("", "name of the other condition")] = None
    phase: Annotated[str | None, Parameter("", "name of the other phase")] = None
    times: Annotated[float, Parameter("", "factor on the other value", 1e-6, 1e6, "log")] = 1.0


@dataclass(frozen=True)
class EqualsWithin:
    """Another measured value, and by which fraction of it a value may differ; what is not named is as in the part."""

    fraction: Annotated[float, Parameter("", "largest difference over the other value", 1e-6, 1e3, "log")]
    controller: Annotated[str | None, Parameter("", "name of the other controller")] = None
    experiment: Annotated[str | None, Parameter("", "name of the other experiment")] = None
    condition: Annotated[str | None, Parameter("", "name of the other condition")] = None
    phase: Annotated[str | None, Parameter("", "name of the other phase")] = None


@dataclass(frozen=True)
class Part:
    """One measurable part of a claim: a metric of one controller, and one of the four ways to judge it."""

    experiment: Annotated[str, Parameter("", "name of an experiment")]
    condition: Annotated[str, Parameter("", "name of a condition")]
    controller: Annotated[str, Parameter("", "name of a controller")]
    metric: Annotated[str, Parameter("", "kind of the metric, or memory_rms.<field>, memory_peak.<field>")]
    axis: Annotated[str, Parameter("", "axis, or number of a component from 1; empty for a metric without axes")] = ""
    phase: Annotated[str, Parameter("", "name of a phase, or 'all'")] = ALL_PHASES
    below: Annotated[Later, Parameter("", "upper limit, in the metric's unit")] = None
    above: Annotated[Later, Parameter("", "lower limit, in the metric's unit")] = None
    less_than: Annotated[LessThan | None, Parameter("", "the other value that it is less than")] = None
    equals_within: Annotated[EqualsWithin | None, Parameter("", "the other value that it is about equal to")] = None


WAYS = ("below", "above", "less_than", "equals_within")
"""The fields of `Part` of which one is given"""


@dataclass(frozen=True)
class Claim:
    """What a publication claims: true if all parts are; or a reason why no trial can decide it."""

    claim: Annotated[str, Parameter("", "the claim, in one's own words")]
    where: Annotated[str, Parameter("", "section, figure, equation")]
    parts: Annotated[tuple[Part, ...], Parameter("", "what is measured; all must hold")] = ()
    reason: Annotated[str, Parameter("", "why it is judged so")] = ""
    undecided: Annotated[str, Parameter("", "why no trial here can decide it")] = ""


@dataclass(frozen=True)
class Study:
    """A reproduction as declared in its file."""

    hilrig: Annotated[Literal[1], Parameter("", "version of this file's form: 1")]
    title: Annotated[str, Parameter("", "the publication that is reproduced")]
    out: Annotated[str, Parameter("", "folder of the result, from where hilrig is called")]
    experiments: Annotated[tuple[str, ...], Parameter("", "experiment files, relative to this one")]
    figures: Annotated[tuple[FigureSpec, ...], Parameter("", "figures")] = ()
    claims: Annotated[tuple[Claim, ...], Parameter("", "claims")] = ()
