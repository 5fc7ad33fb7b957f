#!/bin/sh
# MISRA C:2012 (cppcheck's addon) over a tree's firmware/: misra.sh ROOT. Prints what it finds; exit status 1 if that is anything at all.
# A suppression that no longer suppresses anything is a finding too. unusedFunction and staticFunction are no faults of a library: its
# callers are elsewhere.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
cppcheck=${CPPCHECK:-$here/../../.venv/bin/cppcheck}
cd "$1"
exec "$cppcheck" --addon=misra --std=c11 --enable=all --check-level=exhaustive --inline-suppr --error-exitcode=1 --quiet \
  --template='{file}:{line}: {id}: {message}' --suppressions-list="$here/misra.txt" \
  --suppress=missingIncludeSystem --suppress=checkersReport --suppress=unusedFunction --suppress=staticFunction \
  -Ifirmware/include firmware/src
