"""The benchmark: hilrig's loop beside a bare exchange, other transports and cyclictest, in one interleaved run."""

from hilrig.bench.measurands import QUICK as QUICK
from hilrig.bench.measurands import Settings as Settings
from hilrig.bench.measurands import names as names
from hilrig.bench.run import FORM as FORM
from hilrig.bench.run import measure as measure
