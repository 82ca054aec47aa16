"""The benchmark: hilrig's loop beside a bare exchange, other transports and cyclictest, in one interleaved run."""

from benchmarks.measurands import QUICK as QUICK
from benchmarks.measurands import Settings as Settings
from benchmarks.measurands import names as names
from benchmarks.run import FORM as FORM
from benchmarks.run import measure as measure
