#!/bin/sh
# All static checks: MISRA over the library, the proof that this gate can fail, cppcheck over hal/, the table of what deviates from them, and for
# the host tools ruff and mypy. Tools come from .venv; CPPCHECK names another cppcheck.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
bin=$(cd "$root" && pwd)/.venv/bin
CPPCHECK=${CPPCHECK:-$bin/cppcheck}
export CPPCHECK
cd "$root"

found=build/lint
mkdir -p "$found"
sh "$here/misra.sh" . "$found/misra"
echo "  ok  MISRA C:2012, firmware/"
sh "$here/seeded.sh"

sh "$here/hal.sh" "$found/hal"
echo "  ok  cppcheck, hal/ but semihosting, whose assembly it cannot read"
"$bin/python" "$here/deviations.py" table "$here/DEVIATIONS.md" "$found/misra" "$found/hal"
echo "  ok  DEVIATIONS.md"

if [ -d host_tools/hullguard ]; then
    cd host_tools
    "$bin/ruff" check --quiet .
    "$bin/ruff" format --check --quiet .
    "$bin/mypy" --strict hullguard
    echo "  ok  ruff and mypy, host_tools/"
fi
