"""How many threads BLAS may use."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController

_ONE_AT_A_TIME = threading.RLock()


@cache
def _pools() -> Any:
    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """BLAS on one thread: on vectors and on fronts of a few hundred, threads cost up to ten times what they give.

    The number of threads belongs to the process: other threads of Python wait their turn.
    """
    with _ONE_AT_A_TIME, _pools().limit(limits=1, user_api="blas"):
        yield
