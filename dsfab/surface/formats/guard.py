"""What goes wrong while a file is read, as one sentence that names the file: for meshes and for drawings."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dsfab.errors import SurfaceError
from dsfab.surface.formats.limits import MalformedFileError

log = logging.getLogger(__name__)


@contextmanager
def readable(path: Path, smaller: str, damaged: str) -> Iterator[None]:
    """A file is read within this: whatever is raised there becomes a SurfaceError with a sentence.

    smaller : what to do where memory does not suffice.    damaged : what a foreign parser's error may mean.
    """
    kind = path.suffix[1:].upper()
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of foreign parsers: what matters becomes a SurfaceError
            yield
    except SurfaceError as error:
        raise SurfaceError(f"{path}: {error}") from None
    except MalformedFileError as error:
        raise SurfaceError(f"{path} cannot be read as {kind} ({error}); export it again") from None
    except MemoryError:
        raise SurfaceError(f"{path} needs more memory than there is; {smaller}") from None
    except OSError as error:
        raise SurfaceError(f"{path} cannot be read ({error.strerror or 'the system says no more'})") from None
    except Exception:  # of a foreign parser: its words are no help to a person
        log.debug("reading %s", path, exc_info=True)
        raise SurfaceError(f"{path} cannot be read as {kind} ({damaged}); export it again") from None
