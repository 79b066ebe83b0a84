"""Readers under libFuzzer, or under mutations of our own: `python -m tests.fuzz.target NAMES SECONDS FOLDER [FILES]`.

What breaks one of the NAMES (with commas) is kept in FOLDER/NAME (crash-*, timeout-*, oom-*), what it said in
FOLDER/NAME.log; its line on stdout ends with an exit code, not 0 then. Each is fuzzed in a fork of one process, for
instrumenting what it imports takes longer than a short run. Without atheris files are cut, joined, repeated and have
bits turned over by chance, with a fixed seed, and without looking at what they reach.
"""

import os
import random
import sys
import tempfile
import time
import traceback
from pathlib import Path

LONGEST = 8192
"""Bytes of a file that is tried."""
HANG = 60
"""Seconds after which a file hangs: they take milliseconds, and the machine may be busy."""
MEMORY = 1500
"""Megabytes of the whole process; it takes 300 without a file."""
ENDLESS = -1
"""For how many files are tried: as many as the time allows, as libFuzzer writes it."""
INSTRUMENTED = (
    *(
        "dsfab.surface.files",
        "dsfab.surface.files.mesh_files",
        "dsfab.surface.files.polygons",
        "dsfab.surface.files.drawings",
    ),
    *(
        "dsfab.core.arrays",
        "dsfab.surface.loads.outlines",
        "dsfab.preset.file",
        "dsfab.preset.checks",
        "dsfab.core.toml_files",
    ),
    *("tomllib", "ezdxf.recover", "ezdxf.lldxf", "ezdxf.path"),
)
"""Modules whose branches guide the fuzzer."""


def fuzz_by_coverage(target: str, seconds: float, found: Path, most: int) -> int:
    """Never returns: libFuzzer ends the process."""
    import atheris

    from tests.fuzz import corpus, oracles

    work = Path(tempfile.mkdtemp(prefix="dsfab-fuzz-"))
    start = work / "corpus"
    start.mkdir()
    for k, data in enumerate(corpus.beginnings(target)):
        (start / f"{k:04d}").write_bytes(data)
    named = work / "words"
    named.write_text("".join(f'"{_quoted(word)}"\n' for word in corpus.words(target)))
    options = [
        *(f"-max_total_time={seconds:.0f}", f"-max_len={LONGEST}", f"-timeout={HANG}", f"-rss_limit_mb={MEMORY}"),
        *(
            f"-artifact_prefix={found}/",
            f"-dict={named}",
            "-print_final_stats=1",
            "-seed=1",
            "-verbosity=1",
            f"-runs={most}",
        ),
    ]
    atheris.Setup([sys.argv[0], *options, str(start)], lambda data: oracles.judge(target, data, work))
    atheris.Fuzz()


def _quoted(word: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "".join(f"\\x{byte:02x}" for byte in c.encode()) for c in word)


def fuzz_by_chance(target: str, seconds: float, found: Path, most: int = ENDLESS) -> int:
    """1 once a file breaks a reader, else 0 after so many seconds or files."""
    from tests.fuzz import corpus, oracles

    rng, start, tried = random.Random(1), [*corpus.beginnings(target)], 0
    words = [word.encode() for word in corpus.words(target)] or [b"\xff"]
    with tempfile.TemporaryDirectory(prefix="dsfab-fuzz-") as folder:
        end = time.monotonic() + seconds
        while time.monotonic() < end and start and tried != most:
            data = _mutated(rng, start, words)
            tried += 1
            try:
                oracles.judge(target, data, Path(folder))
            except Exception:
                (found / f"crash-{tried}").write_bytes(data)
                traceback.print_exc()
                return 1
    sys.stderr.write(f"stat::number_of_executed_units: {tried}\n")
    return 0


def _mutated(rng: random.Random, start: list[bytes], words: list[bytes]) -> bytes:
    """One of the files with up to eight changes."""
    data = bytearray(rng.choice(start)[:LONGEST])
    for _ in range(rng.randint(1, 8)):
        a, b = sorted(rng.randint(0, len(data)) for _ in range(2))
        other = rng.choice(start)
        ways = (b"", data[a:b] * 2, rng.choice(words), other[a:b], rng.randbytes(rng.randint(1, 4)))
        if len(data) and rng.random() < 0.3:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        else:
            data[a : min(b, a + rng.choice((0, 1, 4, 64, LONGEST)))] = rng.choice(ways)
    return bytes(data[:LONGEST])


def instrument() -> bool:
    """Whether there is atheris; then all that readers import is instrumented from here on."""
    try:
        import atheris
    except ImportError:
        return False
    with atheris.instrument_imports(include=list(INSTRUMENTED)):
        from tests.fuzz import oracles  # noqa: F401
    return True


def fork(target: str, seconds: float, folder: Path, most: int) -> int:
    """The exit code of one target, fuzzed in a child that writes FOLDER/NAME.log."""
    fuzz = fuzz_by_coverage if instrument() else fuzz_by_chance
    (folder / target).mkdir(parents=True, exist_ok=True)
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    log = os.open(folder / f"{target}.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os._exit(fuzz(target, seconds, folder / target, most) or 0)


def main(targets: str, seconds: str, folder: str, most: str = str(ENDLESS)) -> int:
    """1 if any target broke, else 0."""
    codes = {}
    for target in targets.split(","):
        codes[target] = fork(target, float(seconds), Path(folder), int(most))
        sys.stdout.write(f"{target} {codes[target]}\n")
        sys.stdout.flush()
    return int(any(codes.values()))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main(*sys.argv[1:]))
