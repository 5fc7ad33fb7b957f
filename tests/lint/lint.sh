#!/bin/sh
# All static checks: MISRA over the library, the proof that this gate can fail, cppcheck over hal/, and for the host tools
# ruff and mypy. Tools come from .venv; CPPCHECK names another cppcheck.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
bin=$(cd "$root" && pwd)/.venv/bin
CPPCHECK=${CPPCHECK:-$bin/cppcheck}
export CPPCHECK
cd "$root"

sh "$here/misra.sh" .
echo "  ok  MISRA C:2012, firmware/"
sh "$here/seeded.sh"

"$CPPCHECK" --std=c11 --enable=all --check-level=exhaustive --inline-suppr --error-exitcode=1 --quiet -D__linux__ \
  --template='{file}:{line}: {id}: {message}' --suppressions-list="$here/hal.txt" --suppress=missingIncludeSystem \
  --suppress=checkersReport --suppress=unusedFunction --suppress=staticFunction \
  -Ifirmware/include -Ihal -Ihal/board hal/socketcan hal/loopback hal/board hal/ctucan hal/zynqmp_r5 hal/blank hal/start hal/cortex_m
echo "  ok  cppcheck, hal/ but semihosting, whose assembly it cannot read"

if [ -d host_tools/hullguard ]; then
    cd host_tools
    "$bin/ruff" check --quiet .
    "$bin/ruff" format --check --quiet .
    "$bin/mypy" --strict hullguard
    echo "  ok  ruff and mypy, host_tools/"
fi
