"""From a run directory to a page that answers the experiment's question. Needs nothing of the rig."""

from hilrig.report.making import make_report
from hilrig.report.run_difference import compare, render

__all__ = ["compare", "make_report", "render"]
