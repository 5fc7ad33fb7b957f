#!/bin/sh
# oracle_run on a scalar plant small enough to work out by hand: x(k+1) = x/2 + force + d/4, deadbeat observer, Mo = 2, so
# r(k) = 2 (y(k) - y(k-1)/2 - u(k-1)) and J(k) = 2 ry(k) + ry(k-1) + 2/4, but J(0) = 2 ry(0) + 2 |x(0)|. Radius 1/4 with a frame, 3/4 without
# (one code of 1/2 more). At k = 6 the position jumps to 8 where it should have fallen to 2: r = 12, and the frame that says so leaves no doubt.
set -eu
run=$1
here=$2
found=$("$run" "$here/example.model.txt" "$here/example.signals.csv")
if [ "$found" != "$(cat "$here/example.expected.csv")" ]; then
    echo "oracle_run: other output than $here/example.expected.csv:"
    echo "$found"
    exit 1
fi
echo "oracle_run: as worked out by hand"
