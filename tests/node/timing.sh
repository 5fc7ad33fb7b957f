#!/bin/sh
# timing.sh OUT NODE BUS_TIMER NAME:TICKS:DROP ... : inside with-vcan, detector node, reference and sender at T = 10 ms; files in OUT.
set -eu
out=$1 node=$2 timer=$3
shift 3
for run in "$@"; do
    name=${run%%:*} rest=${run#*:}
    "$node" --model platoon --rest --period 10 --status --timing "$out/$name.missed" >"$out/$name.node" &
    n=$!
    "$timer" watch 10000 >"$out/$name.watch" &
    w=$!
    until grep -q ready "$out/$name.node" && grep -q ready "$out/$name.watch"; do sleep 0.1; done
    "$timer" send 10000 "${rest%%:*}" "${rest#*:}" >"$out/$name.send"
    sleep 1 # both have read what was sent
    kill -TERM $n $w
    wait $n
    wait $w
done
