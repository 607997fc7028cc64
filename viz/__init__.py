"""Looking at the results: Rerun recordings of heatmaps and servo traces, and figures of the tables.

The only place that imports Rerun. It draws what the other rooms computed and computes nothing of its own, so that a
number in a picture is the number in the file.
"""
