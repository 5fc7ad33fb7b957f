#!/bin/sh
# Proof that the MISRA gate can fail: one violation is put into each of several files of a copy, and each must be found where it is.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
mkdir "$copy/firmware"
cp -r "$here/../../firmware/include" "$here/../../firmware/src" "$copy/firmware/"

# file, rule, code
seed() {
    printf '\n%s\n' "$3" >>"$copy/firmware/src/$1"
    echo "$1 misra-c2012-$2" >>"$copy/seeds"
}
seed code.c 7.1 'int32_t seeded_octal(void); int32_t seeded_octal(void) { return 0123; }'
seed linalg.c 15.1 'void seeded_goto(void); void seeded_goto(void) { goto out; out: return; }'
seed hold.c 17.7 'bool seeded_ignored(const hg_hold *x); bool seeded_ignored(const hg_hold *x) { hg_hold_health(x); return true; }'
seed e2e.c 8.4 'uint8_t seeded_undeclared(void) { return 1U; }'
seed trigger.c 14.4 'int32_t seeded_condition(int32_t x); int32_t seeded_condition(int32_t x) { int32_t y = 0; if (x) { y = 1; } return y; }'
seed node.c 15.7 'uint8_t seeded_else(uint8_t x); uint8_t seeded_else(uint8_t x) { uint8_t y = 0U; if (x == 1U) { y = 1U; } else if (x == 2U) { y = 2U; } return y; }'

if sh "$here/misra.sh" "$copy" >"$copy/found" 2>&1; then
    echo "seeded.sh: the gate passed a tree with six violations" >&2
    exit 1
fi
while read -r file rule; do
    grep -q "$file:[0-9]*: $rule:" "$copy/found" || { echo "seeded.sh: $rule in $file was not found; the gate printed:" >&2; cat "$copy/found" >&2; exit 1; }
done <"$copy/seeds"
echo "  ok  MISRA gate finds each of $(wc -l <"$copy/seeds") seeded violations"
