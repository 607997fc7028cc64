"""Files and folders that tell whether the process that made them is still at work.

It holds a lock on the file, which the kernel lets go of when the process ends, however it ends, and which a process
that is stopped, or asleep with its machine, keeps. Whoever gets the lock knows that the other is gone: neither age nor
process id could tell.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
import tempfile
import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

LOCK_SUFFIX = ".lock"

_TRIES = 200
_PAUSE_S = 0.005


class HeldFile:
    """A new file that is held until it is released, or the process ends.

    Args:
        path: The file to be; its folder exists.
        content: What it says.
        outlives_loss: Whether the file stays, held by nobody, when this object is lost without having been released;
            else it goes with it.

    Raises:
        FileExistsError: There is such a file.
        OSError: The folder is not writable.
    """

    def __init__(self, path: Path, content: str = "", *, outlives_loss: bool = False) -> None:
        self.path = path
        self._descriptor = _held_descriptor(path)
        os.write(self._descriptor, content.encode())
        self._lost = weakref.finalize(self, _let_go, path, self._descriptor, os.getpid(), keep=outlives_loss)
        self._owner_pid = os.getpid()

    def release(self) -> None:
        """Remove the file; nothing happens the second time."""
        if self._lost.detach():
            _let_go(self.path, self._descriptor, self._owner_pid, keep=False)


class HeldFolder:
    """A temporary folder of its own that goes when it is closed, or else with the next of its prefix.

    Args:
        prefix: Its name begins so. What killed processes left under this prefix is deleted.
    """

    def __init__(self, prefix: str) -> None:
        folder = temporary_folder()
        clear_abandoned(folder, prefix)
        self.path = folder / f"{prefix}{secrets.token_hex(4)}"
        self._lock = HeldFile(lock_of(self.path))
        self.path.mkdir(mode=0o700)
        self._remove = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.cleanup()

    def cleanup(self) -> None:
        """Delete the folder and what is in it."""
        self._remove()
        self._lock.release()


def temporary_folder() -> Path:
    """Where temporary files go: the folder that Python takes too, but chosen without writing to it.

    Python writes a file to each candidate and deletes it again; a process that is killed in between leaves it there.
    """
    if tempfile.tempdir is None and os.name == "posix":
        named = [os.environ[name] for name in ("TMPDIR", "TEMP", "TMP") if os.environ.get(name)]
        for folder in map(Path, (*named, "/tmp", "/var/tmp", "/usr/tmp")):
            if folder.is_dir() and os.access(folder, os.W_OK | os.X_OK):
                return folder.absolute()
    return Path(tempfile.gettempdir())


def lock_of(path: Path) -> Path:
    """The file that is held for as long as somebody works at ``path``, a file or folder beside it."""
    return path.with_name(path.name + LOCK_SUFFIX)


def is_held(path: Path) -> bool:
    """Whether somebody holds the file. One that is not there, or may not be opened, counts as held."""
    with _abandoned(path) as abandoned:
        return not abandoned


def remove_abandoned(path: Path, *belongings: Path) -> bool:
    """Delete a file that nobody holds, after the files and folders that belong to it; whether it was so."""
    with _abandoned(path) as abandoned:
        if abandoned:
            for one in belongings:
                remove_tree(one)
            path.unlink(missing_ok=True)
        return abandoned


def clear_abandoned(folder: Path, prefix: str, *, containing: str = "") -> None:
    """Delete what killed processes were making in a folder, if its name begins with one text and contains another.

    What may not be deleted, or is in a folder that may not be read, stays.
    """
    with suppress(OSError):
        for path in list(folder.iterdir()):
            if path.name.startswith(prefix) and containing in path.name and path.suffix == LOCK_SUFFIX:
                with suppress(OSError):
                    remove_abandoned(path, path.with_suffix(""))


def remove_tree(path: Path) -> None:
    """Delete a file or folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _held_descriptor(path: Path) -> int:
    for tries_left in range(_TRIES - 1, -1, -1):
        try:
            descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # Between the two somebody may have found it held by nobody, and deleted it.
                if os.fstat(descriptor).st_nlink:
                    return descriptor
            except BlockingIOError:
                pass
            except BaseException:
                os.close(descriptor)
                path.unlink(missing_ok=True)
                raise
            os.close(descriptor)
        except FileExistsError:
            if not tries_left:
                raise
        time.sleep(_PAUSE_S)
    raise FileExistsError(f"{path} is looked at by others all the time: try again")


@contextmanager
def _abandoned(path: Path) -> Iterator[bool]:
    """Whether nobody holds the file, nor will while the block runs."""
    try:
        # A lock needs no right to write, other than over NFS.
        descriptor = os.open(path, os.O_RDWR if os.access(path, os.W_OK) else os.O_RDONLY)
    except OSError:
        yield False
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        abandoned = os.fstat(descriptor).st_nlink > 0
    except OSError:
        abandoned = False
    try:
        yield abandoned
    finally:
        os.close(descriptor)


def _let_go(path: Path, descriptor: int, owner_pid: int, *, keep: bool) -> None:
    # A forked child has the descriptor too, and its end is not that of the owner.
    if not keep and os.getpid() == owner_pid:
        with suppress(OSError):
            path.unlink(missing_ok=True)
    os.close(descriptor)
