"""Jobs of the editor, and their progress."""

import itertools
import logging
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from dsfab.core.errors import DsfabError

ReportProgress = Callable[[str, str], None]  # Function that reports a stage and the work in this stage.


class Cancelled(Exception):  # noqa: N818  # no error
    """Raised after the user has cancelled the job."""


class JobProgress:
    """Reporter of a job's progress; a call reports a stage and a text. Raises Cancelled if the job was cancelled."""

    def __init__(self, stop: threading.Event, tell: ReportProgress) -> None:
        self._stop, self._tell = stop, tell

    def __call__(self, stage: str, text: str) -> None:
        self.check()
        self._tell(stage, text)

    def check(self) -> None:
        """Raise Cancelled if the user has cancelled the job."""
        if self._stop.is_set():
            raise Cancelled


Work = Callable[[JobProgress], dict[str, Any]]  # Function that does a job and returns values for the editor's page.


@dataclass(eq=False)
class EditorJob:
    """A job of the editor. state : "waiting", "running", "done", "failed" or "cancelled"."""

    number: int
    kind: str
    work: Work
    state: str = "waiting"
    stage: str = ""
    text: str = ""
    result: dict[str, Any] = field(default_factory=dict)
    stop: threading.Event = field(default_factory=threading.Event)

    def record(self) -> dict[str, Any]:
        """Return the state and the result of the job, as a dict for the editor's page."""
        return {
            "job": self.number,
            "kind": self.kind,
            "state": self.state,
            "stage": self.stage,
            "text": self.text,
            "result": self.result,
        }


log = logging.getLogger(__name__)
CANCEL_SECONDS = 0.5  # Time for the thread of a cancelled job to end.


class Jobs:
    """Worker threads of the editor, one for each kind of job. Use as `with Jobs() as jobs`."""

    def __init__(self) -> None:
        self._wake = threading.Condition()
        self._waiting: dict[str, EditorJob] = {}
        self._running: dict[str, EditorJob] = {}
        self._workers: dict[str, threading.Thread] = {}
        self._known: dict[int, EditorJob] = {}
        self._numbers = itertools.count(1)
        self._listeners: list[queue.Queue[dict[str, Any] | None]] = []
        self._closed = False

    def __enter__(self) -> "Jobs":
        return self

    def __exit__(self, *_: object) -> None:
        with self._wake:
            self._closed = True
            for job in (*self._running.values(), *self._waiting.values()):
                job.stop.set()
            for listener in self._listeners:
                listener.put(None)
            self._wake.notify_all()
        for worker in self._workers.values():
            worker.join(timeout=5)

    def submit(self, kind: str, work: Work) -> int:
        """Start a job, cancel any older job of the same kind, and return the number of the new job."""
        with self._wake:
            job = EditorJob(next(self._numbers), kind, work)
            self._known[job.number] = job
            for number in list(self._known)[:-64]:
                del self._known[number]
            self._drop(kind, "a newer wish came")
            if kind == "solve":  # a new solution makes measures of the earlier design useless
                self._drop("figures", "outdated")
            self._waiting[kind] = job
            self._notify(job)
            if kind not in self._workers:
                self._start_worker(kind)
            self._wake.notify_all()
        return job.number

    def cancel(self, number: int) -> bool:
        """Cancel a job. Return False if the job has ended or is unknown."""
        with self._wake:
            job = self._known.get(number)
            if job is None or job.state not in ("waiting", "running"):
                return False
            job.stop.set()
            if job.state == "running":
                timer = threading.Timer(CANCEL_SECONDS, self._abandon, [job])
                timer.daemon = True
                timer.start()
            else:
                self._waiting.pop(job.kind, None)
                self._end_job(job, "cancelled", "cancelled")
            return True

    def job(self, number: int) -> EditorJob | None:
        """Return the job with this number, or None if the number is unknown or older than the latest 64 jobs."""
        return self._known.get(number)

    def pending(self, number: int) -> bool:
        """Return True if job `number` is waiting or running, and not cancelled."""
        with self._wake:
            job = self._known.get(number)
            return job is not None and job.state in ("waiting", "running") and not job.stop.is_set()

    def add_listener(self) -> "queue.Queue[dict[str, Any] | None]":
        """Return a queue that receives the record of each changed job, and None when `Jobs` closes."""
        listener: queue.Queue[dict[str, Any] | None] = queue.Queue(maxsize=1000)
        with self._wake:
            self._listeners.append(listener)
        return listener

    def remove_listener(self, listener: "queue.Queue[dict[str, Any] | None]") -> None:
        """Stop adding records to a queue from `add_listener`."""
        with self._wake, suppress(ValueError):
            self._listeners.remove(listener)

    def _drop(self, kind: str, why: str) -> None:
        if waiting := self._waiting.pop(kind, None):
            waiting.stop.set()
            self._end_job(waiting, "cancelled", why)
        if running := self._running.get(kind):
            running.stop.set()

    def _abandon(self, job: EditorJob) -> None:
        with self._wake:
            if self._running.get(job.kind) is not job or self._closed:
                return
            del self._running[job.kind]
            self._end_job(job, "cancelled", "cancelled")
            self._start_worker(job.kind)

    def _start_worker(self, kind: str) -> None:
        worker = threading.Thread(target=self._loop, args=(kind,), name=f"dsfab-editor-{kind}", daemon=True)
        worker.start()  # start comes first, because __exit__ can join only started threads
        self._workers[kind] = worker

    def _loop(self, kind: str) -> None:
        while True:
            with self._wake:
                while kind not in self._waiting and not self._closed:
                    self._wake.wait()
                if self._closed:
                    return
                self._running[kind] = job = self._waiting.pop(kind)
                job.state = "running"
                self._notify(job)
            if not self._run(job):
                return

    def _run(self, job: EditorJob) -> bool:
        def report(stage: str, text: str) -> None:
            with self._wake:
                job.stage, job.text = stage, text
                self._notify(job)

        result: dict[str, Any] = {}
        try:
            result = job.work(JobProgress(job.stop, report))
            state, text = "done", ""
        except Cancelled:
            state, text = "cancelled", "cancelled"
        except DsfabError as error:
            state, text = "failed", str(error)
        except Exception as error:  # the worker continues, and the user sees the message
            log.exception("job %d", job.number)
            state, text = "failed", f"dsfab made a mistake ({type(error).__name__}: {error}); please report it"
        with self._wake:
            if self._running.get(job.kind) is not job:
                return False
            del self._running[job.kind]
            job.result = result
            self._end_job(job, state, text)
            return True

    def _end_job(self, job: EditorJob, state: str, text: str) -> None:
        job.state, job.text = state, text
        self._notify(job)

    def _notify(self, job: EditorJob) -> None:
        record = job.record()
        for listener in self._listeners:
            with suppress(queue.Full):  # only a queue without a reader is full
                listener.put_nowait(record)
