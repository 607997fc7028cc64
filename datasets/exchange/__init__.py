"""Other formats: whole versions of a dataset out, and in again without losing a byte.

One file for each format. Exporting writes beside the target and renames, so a target is whole or absent. Importing
hands sessions to ``transfer``, which checks every attempt and commits once.
"""
