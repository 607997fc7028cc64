"""Other formats: whole versions of a dataset out, and in again without losing a byte.

One file for each format. Exporting writes beside the target and renames, so a target is whole or absent. Importing
hands sessions to ``transfer``, which checks every attempt and commits once.
"""

from handsight.datasets.exchange.commands import ImportReport, export_dataset, import_dataset
from handsight.datasets.exchange.formats import EXPORT_FORMATS, FORMATS, Format

__all__ = ["EXPORT_FORMATS", "FORMATS", "Format", "ImportReport", "export_dataset", "import_dataset"]
