"""One HTML page about a run, to be mailed and opened in any browser without a network.

``pack`` reads the grains of some frames and makes them small, ``tables`` and ``figures`` say how
the run went, ``page`` joins all that with the hand-written scripts beside it into one file,
``write`` decides where it goes.
"""

from multicor_cli.report.write import ReportSummary, write_report

__all__ = ["ReportSummary", "write_report"]
