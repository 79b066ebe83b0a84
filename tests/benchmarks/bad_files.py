"""Mesh files that are bad on purpose, counted: how many of which kind in which format are read, refused, or neither.

    python -m tests.benchmarks.bad_files                # every cut and every seventh bit
    python -m tests.benchmarks.bad_files --every 20     # a sample: every 20th cut and bit

Kinds: n-gons of up to 100 000 corners, marks and other encodings, trailing bytes, odd faces, bombs, files that are cut
off at every byte, and files with one wrong bit. Each kind in each format is read in a process of its own.

    refused  : in one sentence that names the file.        told : read, and what was repaired or dropped is said.
    whole    : what the file says, by what it was made of, or by what trimesh finds in it; so is an OBJ file that ends
               with a whole line and holds the first faces of the good one.
    alone    : read, and trimesh does not read it: nobody to ask.
    silent   : another surface than the file's without a word.      broken : any other exception, or a warning.

The two last must be 0; the script ends with 1 if they are not. `seconds` are the processor's for the worst file, `MB`
what the peak of memory grew by while that kind was read.
"""

import argparse
import multiprocessing
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from dsfab.core.errors import SurfaceError
from dsfab.core.messages import table
from dsfab.core.sparse import peak_memory
from dsfab.surface import surface_in_file
from tests.bad_meshes import FORMATS, GOOD, BadFile, F, bombs, marked, odd_faces, polygons, trailing, written
from tests.fuzz.oracles import as_trimesh_reads

ANSWERS = ("refused", "told", "whole", "alone", "silent", "broken")
KINDS = ("n-gons", "marks", "trailing", "odd faces", "bombs", "cut off", "wrong bit")
CORNERS = (13, 100, 1000, 10_000, 100_000)
"""Of the n-gons, each in five shapes."""
BITS = 7
"""Every so many bits one is turned over, unless told."""


def files(kind: str, name: str, every: int) -> Iterator[tuple[BadFile, float]]:
    """The files of a kind whose names end like `name`, and the area that they say; 0 for that of the good surface."""
    data = FORMATS[name]()
    if kind == "cut off":
        yield from ((BadFile(name, data[:k], None), 0.0) for k in range(1, len(data), every))
    elif kind == "wrong bit":
        for bit in range(0, 8 * len(data), BITS * every):
            wrong = bytearray(data)
            wrong[bit // 8] ^= 1 << bit % 8
            yield BadFile(name, bytes(wrong), None), 0.0
    elif kind == "n-gons":
        yield from polygons(CORNERS) if name == "plain.obj" else ()
    elif name in first_of_suffix():
        made = {"marks": marked, "trailing": trailing, "odd faces": odd_faces, "bombs": bombs}[kind]()
        yield from ((file, 0.0) for file in made if Path(file.name).suffix == Path(name).suffix)


def first_of_suffix() -> set[str]:
    """One format for each suffix: the kinds that are made for a suffix are counted there."""
    return {name for name in FORMATS if name == next(n for n in FORMATS if Path(n).suffix == Path(name).suffix)}


def answer(path: Path, file: BadFile, area: float) -> str:
    """Which of `STATICS_RESULTS` a file got."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = surface_in_file(path)
        except SurfaceError as error:
            return "refused" if path.name in str(error) and "\n" not in str(error) else "broken"
        except Exception:
            return "broken"
    if found.record.remarks:
        return "told"
    surface = found.surface
    corners = in_space(surface.V, surface.F)
    if area:
        return "whole" if abs(surface.area / area - 1) < 1e-5 else "silent"
    if corners == in_space(GOOD.V, F):
        return "whole"
    if path.suffix == ".obj" and file.data.endswith(b"\n") and corners == in_space(GOOD.V, F[: len(surface.F)]):
        return "whole"
    other = as_trimesh_reads(path)
    return "alone" if other is None else "whole" if corners == in_space(*other) else "silent"


def in_space(V: np.ndarray, T: np.ndarray) -> list[list[tuple[float, ...]]]:
    """The triangles by their corners, in an order of their own."""
    return sorted(sorted(map(tuple, P.tolist())) for P in np.round(V[T], 4) + 0.0)


def count(kind: str, name: str, every: int) -> tuple[str, str, Counter[str], float, float, list[str]]:
    """Of a kind in a format: the answers, the worst seconds, MB, and the first files that must not be."""
    counted, worst, before, wrong = Counter[str](), 0.0, peak_memory(), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        for number, (file, area) in enumerate(files(kind, name, every)):
            path, start = written(file, Path(folder)), time.process_time()
            said = answer(path, file, area)
            worst = max(worst, time.process_time() - start)
            counted[said] += 1
            if said in ANSWERS[-2:] and len(wrong) < 3:
                wrong.append(f"{kind}, {file.name}, file {number}: {said}")
    return kind, name, counted, worst, (peak_memory() - before) / 1e6, wrong


def main() -> int:
    """0 where no file was read as another surface without a word, and none broke a reader."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.bad_files", description="bad files, counted")
    parser.add_argument("--every", type=int, default=1, help="of the cuts and the bits, one of so many")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    jobs = [(kind, name, asked.every) for kind in KINDS for name in FORMATS]
    apart = multiprocessing.get_context("spawn")  # a fork begins with the peak of this process
    with ProcessPoolExecutor(asked.workers, mp_context=apart, max_tasks_per_child=1) as pool:
        results = [one for one in pool.map(count, *zip(*jobs, strict=True)) if one[2]]
    rows = [
        (kind, name, str(counted.total()), *(str(counted[said]) for said in ANSWERS), f"{worst:.2f}", f"{more:.0f}")
        for kind, name, counted, worst, more, _ in results
    ]
    whole = sum((counted for _, _, counted, *_ in results), Counter[str]())
    rows.append(("all", "", str(whole.total()), *(str(whole[said]) for said in ANSWERS), "", ""))
    print(table(("kind", "format", "files", *ANSWERS, "seconds", "MB"), rows))
    for *_, wrong in results:
        for line in wrong:
            print(line)
    return 1 if whole["silent"] or whole["broken"] else 0


if __name__ == "__main__":
    sys.exit(main())
