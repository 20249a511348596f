#!/usr/bin/env bash
# Maps drives through synthetic buildings of several storeys with one plan and compares with the
# truth: one row a drive, then a line for every kind.
#
# usage: bench/levels/storeys.sh [KIND]... [FIRST..LAST]
set -euo pipefail
cargo build --release --locked --quiet -p manifoldslam-slam --example storeys
rows=$(mktemp)
trap 'rm -f "$rows"' EXIT
target/release/examples/storeys "$@" | tee "$rows"
awk '$2 ~ /^[0-9]+$/ {
    if (!($1 in n)) order[++kinds] = $1
    n[$1]++; squares[$1] += $9 * $9; crossing[$1] += $8; levels[$1] = levels[$1] " " $3
    if ($9 > worst[$1]) worst[$1] = $9
    if ($9 > 0.05) over[$1]++
    if (!($1 in floors) || $5 < floors[$1]) floors[$1] = $5
}
END {
    for (k = 1; k <= kinds; k++) {
        kind = order[k]
        split(levels[kind], found, " ")
        same = 1
        for (i in found) if (found[i] != found[1]) same = 0
        printf "%-11s %d drives: levels %s, right on floors %.2f %% at least, %d closures across, " \
            "ATE rms %.3f m, worst %.3f m, over 0.05 m in %d\n", kind, n[kind], \
            same ? found[1] : levels[kind], floors[kind], crossing[kind], \
            sqrt(squares[kind] / n[kind]), worst[kind], over[kind]
    }
}' "$rows"
