"""Whether another checkout writes the same files: every preset, and every mesh of DSFAB_MESHES, format by format.

    python tests/benchmarks/same_bytes.py ../before                      # all, without STEP
    python tests/benchmarks/same_bytes.py ../before --step dome roof     # these, with STEP too

For changes of the house that must not change a result: one row for each design that differs, or is refused by one
checkout only or with other words; ends with 1 if there is any. Meshes are built as `roof`, closed ones as `figurine`.
"""

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
MESHES = Path(os.environ.get("DSFAB_MESHES", ROOT / "../shared/meshes")).resolve()
CLOSED = ("blub", "bob", "camelhead", "spot", "torus")
FORMATS = ("stl", "3mf", "ply", "glb", "dxf")


def designs() -> dict[str, tuple[str, ...]]:
    """By name, the words after `dsfab build`."""
    presets = {path.stem: (path.stem,) for path in sorted((ROOT / "presets").rglob("*.toml"))}
    for name in ("roof", "figurine"):  # they come without a mesh
        presets.pop(name, None)
    meshes = {path.name: (_kind(path), "--mesh", str(path)) for path in sorted(MESHES.glob("*.obj"))}
    return presets | meshes


def _kind(mesh: Path) -> str:
    return "figurine" if mesh.stem in CLOSED else "roof"


def written(checkout: Path, words: tuple[str, ...], formats: tuple[str, ...]) -> dict[str, str]:
    """By file name, the hash of what this checkout builds; or the sentence with which it refuses."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        command = [sys.executable, "-c", "from dsfab.app.cli import main; raise SystemExit(main())", "build", *words]
        command += ["--format", ",".join(formats), "--no-preview", "--quiet", "-o", folder]
        environment = {**os.environ, "PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            return {"refused": done.stderr.strip()}
        files = [path for path in Path(folder).iterdir() if path.suffix[1:] in formats]
        return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(files)}


def main(arguments: list[str]) -> int:
    before, step, only = Path(arguments[0]).resolve(), "--step" in arguments, arguments[1:]
    formats = (*FORMATS, "step") if step else FORMATS
    wanted = [word for word in only if word != "--step"]
    different = 0
    for name, words in designs().items():
        if wanted and name not in wanted:
            continue
        old, new = (written(checkout, words, formats) for checkout in (before, ROOT))
        off = sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key))
        different += bool(off)
        said = "; ".join(f"{key}: {old.get(key, '-')[:80]} -> {new.get(key, '-')[:80]}" for key in off)
        print(f"{name:22} {'same' if not off else said} ({len(new)} files)", flush=True)
    print(f"{different} differ")
    return 1 if different else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
