"""One coordinator for each folder."""

import os
import platform
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dsfab.errors import DsfabError

NAME = "coordinator.lock"


@contextmanager
def only_coordinator(folder: Path) -> Iterator[None]:
    """Hold a sweep folder; raises DsfabError while another process holds it.

    The lock is SQLite's own on a file of its own: it works wherever the database does, and the system lets go of it
    when the process ends, however it ends. Who holds it stands beside it, for the message only.
    """
    holder = folder / f"{NAME}.txt"
    connection = sqlite3.connect(folder / NAME, timeout=0, isolation_level=None)
    try:
        try:
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            if "locked" not in str(error):
                raise DsfabError(f"{folder} cannot be written: {error}; choose another folder with -o") from error
            raise DsfabError(
                f"{_held_by(holder)} is running the sweep in {folder} already; wait for it, or stop it first"
            ) from None
        with suppress(OSError):
            holder.write_text(f"process {os.getpid()} on {platform.node()}", encoding="utf-8")
        yield
        with suppress(OSError):
            holder.unlink()
    finally:
        connection.close()


def _held_by(holder: Path) -> str:
    try:
        return holder.read_text(encoding="utf-8") or "another dsfab"
    except OSError:
        return "another dsfab"
