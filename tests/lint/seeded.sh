#!/bin/sh
# Proof that the MISRA gate can fail: one violation is put into each of several files of a copy, and each must be found where it is.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
mkdir "$copy/firmware"
cp -r "$here/../../firmware/include" "$here/../../firmware/src" "$copy/firmware/"

# file, rule, result, name, parameters, body
seed() {
    printf '\n%s %s(%s);\n%s %s(%s) %s\n' "$3" "$4" "$5" "$3" "$4" "$5" "$6" >>"$copy/firmware/src/$1"
    echo "$1 misra-c2012-$2" >>"$copy/seeds"
}
seed code.c 7.1 int32_t seeded_octal void '{ return 0123; }'
seed linalg.c 15.1 void seeded_goto void '{ goto out; out: return; }'
seed hold.c 17.7 bool seeded_ignored 'const hg_hold *x' '{ hg_hold_health(x); return true; }'
seed trigger.c 14.4 int32_t seeded_condition 'int32_t x' '{ int32_t y = 0; if (x) { y = 1; } return y; }'
seed node.c 15.7 uint8_t seeded_else 'uint8_t x' '{ uint8_t y = 0U; if (x == 1U) { y = 1U; } else if (x == 2U) { y = 2U; } return y; }'
seed frame.c 10.3 uint8_t seeded_narrowing 'uint32_t x' '{ uint8_t y = x; return y; }'

if sh "$here/misra.sh" "$copy" >"$copy/found" 2>&1; then
    echo "seeded.sh: the gate passed a tree with violations in it" >&2
    exit 1
fi
while read -r file rule; do
    if ! grep -q "$file:[0-9]*: $rule:" "$copy/found"; then
        echo "seeded.sh: $rule in $file was not found; the gate printed:" >&2
        cat "$copy/found" >&2
        exit 1
    fi
done <"$copy/seeds"
echo "  ok  MISRA gate finds each of $(wc -l <"$copy/seeds") seeded violations"
