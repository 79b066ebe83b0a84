"""A folder of results: all of its files, or none."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dsfab.errors import ExportError


@contextmanager
def whole_or_nothing(folder: Path) -> Iterator[Path]:
    """A folder to write in whose files move to `folder` at the end; if anything fails, `folder` is left as it was."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=".partial-", dir=folder))
    except OSError as error:
        raise ExportError(f"cannot write to {folder}: {error.strerror}; choose another folder with -o") from None
    try:
        try:
            yield partial
        except ExportError as error:  # name the place that the user gave
            raise ExportError(str(error).replace(str(partial), str(folder))) from None
        for path in sorted(partial.iterdir()):
            os.replace(path, folder / path.name)
        missing = []
    except OSError as error:
        raise ExportError(
            f"writing to {folder} failed: {error.strerror}; free some space or choose another with -o"
        ) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        for parent in missing:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
