"""From plain data to checked dataclasses, by the annotations of their fields; descriptions of what a file may hold."""

from hilrig.experiment.schema.description import ParameterRow as ParameterRow
from hilrig.experiment.schema.description import describe_kind as describe_kind
from hilrig.experiment.schema.description import describe_record as describe_record
from hilrig.experiment.schema.description import json_schema as json_schema
from hilrig.experiment.schema.description import records_in as records_in
from hilrig.experiment.schema.reading import read_record as read_record
from hilrig.experiment.schema.reading import readers_of as readers_of
from hilrig.experiment.schema.terms import ONLY_AXIS as ONLY_AXIS
from hilrig.experiment.schema.terms import ByAxis as ByAxis
from hilrig.experiment.schema.terms import Context as Context
from hilrig.experiment.schema.terms import InvalidError as InvalidError
from hilrig.experiment.schema.terms import Later as Later
from hilrig.experiment.schema.terms import Reader as Reader
from hilrig.experiment.schema.terms import SchemaFinding as SchemaFinding
