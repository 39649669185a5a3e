"""Which output formats and schemas there are; nothing is imported here: help stays quick."""

from __future__ import annotations

from typing import Final, Literal

CHECK_FORMATS: Final = ("json", "html", "junit", "sarif", "github", "markdown", "csv", "bill")
OPTIMIZE_FORMATS: Final = ("json", "html", "csv")
SIMULATE_FORMATS: Final = ("json", "html", "csv")
DIAGNOSE_FORMATS: Final = ("json", "html", "markdown")
STUDY_FORMATS: Final = (
    "csv", "parquet", "json", "html", "junit", "sarif", "github", "markdown",
)  # fmt: skip
DIFF_FORMATS: Final = ("json", "html", "markdown", "github")
REPRODUCE_FORMATS: Final = ("json", "html")
TIMING_FORMATS: Final = ("json", "html", "markdown")
ACCEPT_FORMATS: Final = ("json", "html", "junit", "sarif", "github", "markdown")
LOG_FORMATS: Final = ("json", "html", "markdown")
AUDIT_FORMATS: Final = ("json", "html", "markdown")
PLAN_FORMATS: Final = ("json", "html", "markdown", "csv", "kml", "qgc")
GEODETIC_FORMATS: Final = ("kml", "qgc")  # of a plan: they need an origin on the globe
WATCH_FORMATS: Final = ("json", "html", "markdown")
CATALOG_FORMATS: Final = ("json",)
CHART_FORMATS: Final = ("svg", "png")  # of subjects with charts: a file each, into a folder
EVERY_FORMAT: Final = frozenset((
    *CHECK_FORMATS, *STUDY_FORMATS, *DIFF_FORMATS, *PLAN_FORMATS, *LOG_FORMATS, *CHART_FORMATS,
))  # fmt: skip
PICTURED: Final = ("html", *CHART_FORMATS)  # what shows charts

NEXT_TO_TEXT: Final = ("junit", "sarif", "github")  # tell no other designs than the chosen one

# Pages and binary tables are for files; a bare format name does not send them to a terminal.
NOT_FOR_A_TERMINAL: Final = ("html", "parquet")

# Kinds of files and of results that have a JSON Schema.
FileName = Literal["spec", "catalog", "study"]
ResultName = Literal[
    "acceptance",
    "audit",
    "catalog-check",
    "catalog-entry",
    "catalog-list",
    "diagnosis",
    "diff",
    "log",
    "optimization",
    "plan",
    "reproduction",
    "simulation",
    "study-result",
    "timing",
    "verdict",
    "verdicts",
    "watch",
]
