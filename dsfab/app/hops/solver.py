"""Requests, one after the other, in a process of their own, which is ended when one takes too long."""

import json
import logging
import multiprocessing
import threading
from collections.abc import Mapping
from multiprocessing.pool import Pool
from typing import Any, Self

from dsfab.app.hops.protocol import HopsError, read_request
from dsfab.errors import DsfabError

log = logging.getLogger(__name__)


class Solver:
    """Solves for one client at a time. A context: its process ends with it."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._turn = threading.Lock()
        self._pool: Pool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def solve(self, name: str, body: Mapping[str, Any]) -> str:
        """The answer to a request to a component, JSON; raises HopsError with the sentence of what was refused."""
        with self._turn:
            if self._pool is None:
                self._pool = multiprocessing.get_context("spawn").Pool(1)
            try:
                done, text = self._pool.apply_async(answered, (name, dict(body))).get(self.seconds)
            except multiprocessing.TimeoutError:
                self._end()
                raise HopsError(
                    f"this took more than {self.seconds:g} s and was ended; make the mesh coarser, or start dsfab hops "
                    "with more --seconds"
                ) from None
        if not done:
            raise HopsError(text)
        return str(text)

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()
            self._pool = None


def answered(name: str, body: Mapping[str, Any]) -> tuple[bool, str]:
    """Whether a request was answered, and the answer as JSON or the sentence of what was refused."""
    from dsfab.app.hops.components import COMPONENTS

    component = COMPONENTS[name]
    try:
        return True, json.dumps(component.answer(read_request(component, body)))
    except DsfabError as error:
        return False, str(error)
    except Exception as error:  # a mistake of ours is an answer too: Grasshopper goes on
        log.exception("%s", name)
        return False, f"dsfab made a mistake ({type(error).__name__}: {error}); please report it"
