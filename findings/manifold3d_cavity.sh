#!/usr/bin/env bash
# What: manifold3d 3.5.4, `Manifold.decompose`, `Manifold.compose` and `Manifold.batch_boolean`.
# Input: a cube of side 4 with a closed cube of side 2 inside taken away. Its volume is 56.
# An expert expects: the hollow cube is one part, or its parts go together to the hollow cube again.
#       The documentation says that compose is the inverse of decompose, and that a sum by batch_boolean replaces it.
# It does: the cavity is a part of its own, a Manifold with the volume -8 and the status NoError.
#       compose and batch_boolean both fill the cavity: 64 instead of 56. Their status is NoError, too.
#       Whoever splits a solid so, and joins its parts again, loses every closed cavity.
# Output seen:
#       hollow cube: volume 56, parts 64 and -8
#       compose: 64, batch_boolean: 64; every status NoError: True
# Date 2026-11-29
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install --quiet --disable-pip-version-check manifold3d==3.5.4 numpy==2.4.6 2>pip.log ||
    { cat pip.log; exit 2; }

cat >test.py <<'PYTHON'
import sys

from manifold3d import Error, Manifold, OpType

hollow = Manifold.cube([4, 4, 4], True) - Manifold.cube([2, 2, 2], True)
parts = hollow.decompose()
again = [Manifold.compose(parts), Manifold.batch_boolean(parts, OpType.Add)]
fine = all(part.status() == Error.NoError for part in [hollow, *parts, *again])
volumes = [round(part.volume(), 6) for part in parts]
print(f"hollow cube: volume {hollow.volume():g}, parts {' and '.join(f'{v:g}' for v in volumes)}")
print(f"compose: {again[0].volume():g}, batch_boolean: {again[1].volume():g}; every status NoError: {fine}")
found = fine and sorted(volumes) == [-8, 64] and all(abs(whole.volume() - 64) < 1e-6 for whole in again)
if not (found and abs(hollow.volume() - 56) < 1e-6):
    sys.exit("Changed: manifold3d no longer fills the cavity of parts that decompose gave and compose joins.")
PYTHON
nice venv/bin/python test.py
