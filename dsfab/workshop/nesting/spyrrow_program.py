"""Program that nests parts on a sheet by spyrrow, in a separate process.

    python -P spyrrow_program.py JOB.json

JOB.json has, in metres:
    items          : [[outline [[x, y], ..], rotations in degrees], ..]
    height, length : size of the sheet
    gap, seed      : distance between items, and a number without unit

The program prints one line: [[item number, degrees, x, y], ..], or null without a solution."""

import json
import os
import sys
import threading
from pathlib import Path
from typing import Any


def main(path: str) -> None:
    """Print the first arrangement of the parts that fits on the sheet."""
    import spyrrow

    job = json.loads(Path(path).read_text(encoding="utf-8"))
    shapes = enumerate(job["items"])
    items = [spyrrow.Item(str(k), [(x, y) for x, y in shape], 1, turns) for k, (shape, turns) in shapes]
    instance = spyrrow.StripPackingInstance("sheet", job["height"], items)
    config = spyrrow.StripPackingConfig(
        early_termination=True,
        total_computation_time=3600,  # the calling process ends this process sooner
        num_workers=1,
        seed=job["seed"],
        min_items_separation=job["gap"] or None,
    )
    queue, ended = spyrrow.ProgressQueue(), list[Any]()
    search = threading.Thread(target=lambda: ended.append(instance.solve(config, queue)), daemon=True)
    search.start()
    bad = spyrrow.ReportType.ExplInfeas, spyrrow.ReportType.ExplImproving
    while search.is_alive():
        search.join(0.1)
        solutions = (solution for kind, solution in queue.drain() if kind not in bad)
        if solution := next((solution for solution in solutions if solution.width <= job["length"]), None):
            _print_and_exit(solution)
    if ended and ended[0].width <= job["length"]:
        _print_and_exit(ended[0])
    print("null")  # noqa: T201  the calling process reads it


def _print_and_exit(solution: Any) -> None:
    placed = [[int(item.id), item.rotation, *item.translation] for item in solution.placed_items]
    print(json.dumps(placed), flush=True)  # noqa: T201
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1])
