#!/bin/sh
# clang-tidy and gcc -fanalyzer over firmware/src, hal/ and firmware/apps: no finding. TIDY=FILE looks at that one alone. Semihosting is for other
# processors.
# Findings that do not hold have their reason in clang-tidy.yaml, or beside the line.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/../.."
tidy=.venv/bin/clang-tidy
[ -x "$tidy" ] || { echo "clang-tidy is missing: host_tools/setup.sh check" >&2; exit 1; }
includes="-Ifirmware/include -Ifirmware/models -Ifirmware/apps -Ihal -Ihal/board -Ihal/socketcan -Ihal/ctucan -Ihal/zynqmp_r5 -Ihal/start"
sources="${TIDY:-$(ls firmware/src/*.c firmware/apps/*.c hal/*/*.c | grep -v '^hal/semihosting/')}"
findings=$(mktemp)
trap 'rm -f "$findings"' EXIT
# shellcheck disable=SC2086
"$tidy" --config-file="$here/clang-tidy.yaml" --quiet $sources -- -std=c11 -D__linux__ $includes >"$findings" 2>/dev/null || {
    cat "$findings"
    exit 1
}
# What is for one processor's assembler does not compile here.
analysed=0
for source in $(echo "$sources" | grep -v -e '^hal/zynqmp_r5/board' -e '^hal/cortex_m/' -e '^hal/ctucan/board'); do
    # shellcheck disable=SC2086
    gcc -std=c11 -O2 -fanalyzer -Wall -Wextra -Werror -ffp-contract=off $includes -c "$source" -o /dev/null
    analysed=$((analysed + 1))
done
[ -z "${TIDY:-}" ] || exit 0 # a part says nothing of the whole
checked=$(echo "$sources" | wc -l)
.venv/bin/python tests/promises/result.py tidy 'clang-tidy and gcc -fanalyzer find nothing in library, HAL and applications; every check that is off has its reason' \
    "$checked files without a finding of clang-tidy, $analysed without one of -fanalyzer"
echo "  ok  tidy: $checked files, $analysed of them with -fanalyzer"
