"""The report: from a run directory to a page that answers the experiment's question. Independent of the rig."""

from hilrig.report.junit import junit_xml
from hilrig.report.making import make_report, write_report
from hilrig.report.measuring import measure_run
from hilrig.report.run_difference import compare_runs, render

__all__ = ["compare_runs", "junit_xml", "make_report", "measure_run", "render", "write_report"]
