"""Many tasks on workers, answered in order: processes of this machine, or a Ray cluster.

This room knows nothing of grasps and imports no other. What a worker opens once, and what it does with a task, is the
business of whoever hands out the tasks: collection, evaluation, ablation.
"""
