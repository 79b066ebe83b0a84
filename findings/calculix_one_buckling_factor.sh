#!/usr/bin/env bash
# What: CalculiX 2.20 (Debian package calculix-ccx 2.20-1). *BUCKLE computes the lowest linear buckling factors.
# Input: a shallow dome of 8 x 8 m, 50 mm thick, on a pinned edge, pressed at all nodes: 144 elements of type C3D20R.
# An expert expects: the first factor is the same for 1 requested factor and for 6. The default accuracy is 0.01.
# It does: of 1 requested factor the result is 5.4 % too high. Of 6 requested factors the first is right to 2e-5.
#       The log of the run has no warning. With 20 Lanczos vectors (third number of the line) the error is 1.5e-4.
#       If the load pulls instead, the first factor is -9.5e8 of 1 requested factor, and -3.5e7 of 6.
# Output seen: 1 factor 18870.5; 2 factors 17969.9; 6 factors 17897.7; 12 factors 17897.4; 1 factor, 20 vectors 17900.1
# Date 2026-11-30. Needs Debian 12 (bookworm, amd64) and python3.
set -euo pipefail

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -qq download calculix-ccx=2.20-1 libarpack2=3.8.0-3 libspooles2.2=2.2-14 libblas3=3.11.0-2 \
    liblapack3=3.11.0-2 libgfortran5 libquadmath0 2>apt.log || { cat apt.log; exit 2; }
for package in *.deb; do dpkg -x "$package" root; done
libraries="$work/root/usr/lib/x86_64-linux-gnu"
export LD_LIBRARY_PATH="$libraries/blas:$libraries/lapack:$libraries" OMP_NUM_THREADS=1

cat >model.py <<'PYTHON'
import sys

CELLS, numbers, middles = 12, {}, []


def node(i, j, k):  # half steps along both sides, and through the thickness
    if (i, j, k) not in numbers:
        numbers[i, j, k] = len(numbers) + 1
        x, y = 4 * i / CELLS - 4, 4 * j / CELLS - 4
        print(f"{numbers[i, j, k]}, {x:.12g}, {y:.12g}, {-1.5 * (x * x + y * y) / 32 + 0.025 * k:.12g}")
    return numbers[i, j, k]


print("*NODE, NSET=ALL")
corners, sides, bricks = [(0, 0), (2, 0), (2, 2), (0, 2)], [(1, 0), (2, 1), (1, 2), (0, 1)], []
for i in range(0, 2 * CELLS, 2):
    for j in range(0, 2 * CELLS, 2):
        layers = ((corners, -1), (corners, 1), (sides, -1), (sides, 1), (corners, 0))
        bricks.append([node(i + a, j + b, k) for places, k in layers for a, b in places])
print("*ELEMENT, TYPE=C3D20R, ELSET=ALL")
for number, brick in enumerate(bricks, 1):
    print(number, *brick[:10], sep=", ", end=",\n")
    print(*brick[10:], sep=", ")
print("*MATERIAL, NAME=WOOD\n*ELASTIC\n11e9, .3\n*SOLID SECTION, ELSET=ALL, MATERIAL=WOOD\n*BOUNDARY")
for (i, j, _), number in numbers.items():
    if {i, j} & {0, 2 * CELLS}:
        print(f"{number}, 1, 3")
print(f"*STEP\n*BUCKLE\n{sys.argv[1]}\n*CLOAD")
for number in numbers.values():
    print(f"{number}, 3, -1.")
print("*NODE PRINT, NSET=ALL\nU\n*END STEP")
PYTHON

lowest() { # lowest NAME DATA: the first factor of a run
    python3 model.py "$2" >"$1.inp"
    root/usr/bin/ccx "$1" >"$1.log" || { tail "$1.log"; exit 2; }
    awk '/B U C K L I N G/ { found = 1 } found && $1 == "1" { print $2; exit }' "$1.dat"
}
one=$(lowest one 1) six=$(lowest six 6) twelve=$(lowest twelve 12) vectors=$(lowest vectors "1, 0.01, 20")
echo "1 factor $one; 6 factors $six; 12 factors $twelve; 1 factor with 20 Lanczos vectors $vectors"
python3 - "$one" "$six" "$twelve" "$vectors" <<'PYTHON' || { echo "the behaviour has changed"; exit 1; }
import sys

one, six, twelve, vectors = map(float, sys.argv[1:])
sys.exit(not (1.03 < one / twelve and abs(six / twelve - 1) < 1e-3 and abs(vectors / twelve - 1) < 1e-3))
PYTHON
