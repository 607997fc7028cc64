"""Object sets that the simulated station can drop onto its table.

Sets that come with handsight: ``blocks-train`` and ``blocks-test``, the procedural shapes of PyBullet, and
``household-train`` and ``household-test``, household objects generated on this machine. Any folder of meshes becomes
a set with :func:`~.meshes.importer.import_folder`. Every set loads through :func:`~.catalogue.load_object_set`.
"""
