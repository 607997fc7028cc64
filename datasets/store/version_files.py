"""Where a version has its content, and whether that is all there."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from handsight.datasets.store.file_damage import FileDamage
from handsight.datasets.store.manifests import manifest_damage
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.snapshot_reader import SnapshotReader


class VersionFiles:
    """Where a version has its content, so that what two versions share need be read once.

    Raises:
        CorruptDataError: The snapshot cannot be read.
        StorageError: The machine cannot read it.
    """

    def __init__(self, repository: GraspRepository, snapshot_id: str) -> None:
        self._reader = SnapshotReader(repository)
        self._snapshot = self._reader.snapshot(snapshot_id)
        self._store = self._reader.store(snapshot_id)

    def under(self, folder: str) -> Hashable:
        """Versions in which this is equal hold the same bytes under that folder.

        Raises:
            CorruptDataError, StorageError: What describes the groups and arrays there cannot be read.
        """
        nodes = self._snapshot.nodes
        paths = sorted(path for path in nodes if f"{path}/".startswith(f"/{folder}/"))
        described = self._reader.descriptions(self._store, paths, folder)
        return tuple((path, nodes[path], described[path]) for path in paths)

    def damage(self, asked: Callable[[str], bool]) -> list[FileDamage]:
        """Manifests that cannot be read or name other chunks than the snapshot says, of the arrays asked for by path.

        Raises:
            StorageError: The machine cannot read them.
        """
        paths = [path for path, node in self._snapshot.nodes.items() if node.manifests and asked(path)]
        return list(manifest_damage(self._reader, self._snapshot, self._store, paths))
