"""Figures for documents and reports, drawn with matplotlib or pixel by pixel."""
