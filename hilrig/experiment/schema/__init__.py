"""From plain data to checked dataclasses, by what their fields are annotated with; what a file may hold, described."""

from hilrig.experiment.schema.description import Row as Row
from hilrig.experiment.schema.description import describe as describe
from hilrig.experiment.schema.description import json_schema as json_schema
from hilrig.experiment.schema.reading import read as read
from hilrig.experiment.schema.terms import ONLY_AXIS as ONLY_AXIS
from hilrig.experiment.schema.terms import ByAxis as ByAxis
from hilrig.experiment.schema.terms import Context as Context
from hilrig.experiment.schema.terms import Finding as Finding
from hilrig.experiment.schema.terms import InvalidError as InvalidError
from hilrig.experiment.schema.terms import Later as Later
