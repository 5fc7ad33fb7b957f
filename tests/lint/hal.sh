#!/bin/sh
# cppcheck over hal/: hal.sh FINDINGS. Prints what it finds beyond hal.txt, as misra.sh does; FINDINGS: file for all that it finds.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
cppcheck=${CPPCHECK:-$here/../../.venv/bin/cppcheck}
status=0
cd "$here/../.."
"$cppcheck" --std=c11 --enable=all --check-level=exhaustive --inline-suppr --error-exitcode=1 --quiet -D__linux__ \
  --template='{file}:{line}: {id}: {message}' --suppress=missingIncludeSystem \
  --suppress=checkersReport --suppress=unusedFunction --suppress=staticFunction \
  -Ifirmware/include -Ihal -Ihal/board hal/socketcan hal/loopback hal/board hal/ctucan hal/zynqmp_r5 hal/blank hal/start hal/cortex_m >"$1" 2>&1 || status=$?
if [ "$status" -gt 1 ]; then
    cat "$1" >&2
    exit "$status"
fi
.venv/bin/python "$here/deviations.py" check "$here/hal.txt" "$1"
