#!/bin/sh
# MISRA C:2012 (cppcheck's addon) over a tree's firmware/: misra.sh ROOT [FINDINGS]. Prints what it finds beyond misra.txt; exit status 1 if that is
# anything at all, or if misra.txt has a rule that nothing breaks any more. FINDINGS: file for all that it finds.
# A suppression that no longer suppresses anything is a finding too. unusedFunction and staticFunction are no faults of a library: its
# callers are elsewhere.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
cppcheck=${CPPCHECK:-$here/../../.venv/bin/cppcheck}
findings=${2:-$(mktemp)}
[ $# -gt 1 ] || trap 'rm -f "$findings"' EXIT
status=0
(cd "$1" && "$cppcheck" --addon=misra --std=c11 --enable=all --check-level=exhaustive --inline-suppr --error-exitcode=1 --quiet \
  --template='{file}:{line}: {id}: {message}' \
  --suppress=missingIncludeSystem --suppress=checkersReport --suppress=unusedFunction --suppress=staticFunction \
  -Ifirmware/include firmware/src) >"$findings" 2>&1 || status=$?
if [ "$status" -gt 1 ]; then
    cat "$findings" >&2
    exit "$status"
fi
"$here/../../.venv/bin/python" "$here/deviations.py" check "$here/misra.txt" "$findings"
