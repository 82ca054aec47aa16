"""From plain data to checked dataclasses, by pydantic; what a file may hold, for editors and people."""

from hilrig.schema.description import Row as Row
from hilrig.schema.description import describe as describe
from hilrig.schema.description import json_schema as json_schema
from hilrig.schema.reading import read as read
from hilrig.schema.terms import ONLY_AXIS as ONLY_AXIS
from hilrig.schema.terms import ByAxis as ByAxis
from hilrig.schema.terms import Context as Context
from hilrig.schema.terms import Finding as Finding
from hilrig.schema.terms import InvalidError as InvalidError
from hilrig.schema.terms import Later as Later
