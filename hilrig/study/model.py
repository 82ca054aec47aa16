"""The content of a study's file, as frozen dataclasses; hilrig.experiment.schema reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from hilrig.core.parameters import Parameter
from hilrig.experiment.schema import Later
from hilrig.experiment.trial import ALL_PHASES


@dataclass(frozen=True)
class FigureSpec:
    """One figure: one quantity over time, of one or more controllers, in one panel."""

    figure: Annotated[str, Parameter("", "number in the publication")]
    title: Annotated[str, Parameter("", "title")]
    experiment: Annotated[str, Parameter("", "name of an experiment")]
    condition: Annotated[str, Parameter("", "name of a condition")]
    controllers: Annotated[tuple[str, ...], Parameter("", "names of the controllers to draw")]
    quantity: Annotated[str, Parameter("", "quantity to draw, or memory.<field> of the law's memory")]
    axis: Annotated[str | None, Parameter("", "axis, or number of a component from 1; default: all of them")] = None
    zoom: Annotated[
        tuple[float, float] | None, Parameter("s", "time interval that a second panel enlarges", 0.0, 1e5)
    ] = None
    caption: Annotated[str, Parameter("", "text of the caption")] = ""


@dataclass(frozen=True)
class LessThan:
    """Another measured value, times a factor; everything not named is as in the part."""

    controller: Annotated[str | None, Parameter("", "name of the other controller")] = None
    experiment: Annotated[str | None, Parameter("", "name of the other experiment")] = None
    condition: Annotated[str | None, Parameter("", "name of the other condition")] = None
    phase: Annotated[str | None, Parameter("", "name of the other phase")] = None
    times: Annotated[float, Parameter("", "factor on the other value", 1e-6, 1e6, "log")] = 1.0


@dataclass(frozen=True)
class EqualsWithin:
    """Another measured value, and the fraction of it by which a value may differ; the rest is as in the part."""

    fraction: Annotated[float, Parameter("", "largest difference over the other value", 1e-6, 1e3, "log")]
    controller: Annotated[str | None, Parameter("", "name of the other controller")] = None
    experiment: Annotated[str | None, Parameter("", "name of the other experiment")] = None
    condition: Annotated[str | None, Parameter("", "name of the other condition")] = None
    phase: Annotated[str | None, Parameter("", "name of the other phase")] = None


@dataclass(frozen=True)
class Part:
    """One measurable part of a claim: a metric of one controller, and one of four ways to judge it."""

    experiment: Annotated[str, Parameter("", "name of an experiment")]
    condition: Annotated[str, Parameter("", "name of a condition")]
    controller: Annotated[str, Parameter("", "name of a controller")]
    metric: Annotated[str, Parameter("", "kind of the metric, or memory_rms.<field>, memory_peak.<field>")]
    axis: Annotated[str, Parameter("", "axis, or number of a component from 1; empty for a metric without axes")] = ""
    phase: Annotated[str, Parameter("", "name of a phase, or 'all'")] = ALL_PHASES
    below: Annotated[Later, Parameter("", "upper limit, in the metric's unit")] = None
    above: Annotated[Later, Parameter("", "lower limit, in the metric's unit")] = None
    less_than: Annotated[LessThan | None, Parameter("", "another value; the metric is less than it")] = None
    equals_within: Annotated[EqualsWithin | None, Parameter("", "another value; the metric is about equal to it")] = (
        None
    )


WAYS = ("below", "above", "less_than", "equals_within")
"""The fields of `Part` of which exactly one must be given"""


@dataclass(frozen=True)
class Claim:
    """A claim of a publication, which holds if all its parts hold; or a reason why no trial can decide it."""

    claim: Annotated[str, Parameter("", "the claim, in one's own words")]
    where: Annotated[str, Parameter("", "section, figure, equation")]
    parts: Annotated[tuple[Part, ...], Parameter("", "measurable parts, all of which must hold")] = ()
    reason: Annotated[str, Parameter("", "why it is judged in this way")] = ""
    undecided: Annotated[str, Parameter("", "why no trial here can decide it")] = ""


@dataclass(frozen=True)
class Study:
    """A study to reproduce, as declared in its file."""

    hilrig: Annotated[Literal[1], Parameter("", "version of the file format: 1")]
    title: Annotated[str, Parameter("", "the publication that is reproduced")]
    out: Annotated[str, Parameter("", "folder of the result, relative to where hilrig is called")]
    experiments: Annotated[tuple[str, ...], Parameter("", "experiment files, relative to this one")]
    figures: Annotated[tuple[FigureSpec, ...], Parameter("", "figures")] = ()
    claims: Annotated[tuple[Claim, ...], Parameter("", "claims")] = ()
