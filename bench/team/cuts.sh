#!/usr/bin/env bash
# Cuts logs into robots with unknown starts, maps them together, and scores the relations that cross
# pieces beside the single log's map on the same relations.
#
# usage: bench/team/cuts.sh [DATA]      DATA holds LOG.clf.bz2 and LOG.relations
set -euo pipefail
data=${1:-../shared/data/laser-logs}
cargo build --release --locked --quiet
program=target/release/manifoldslam
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for case in intel:3 intel:6 aces:2 mit-csail:2; do
    log=${case%:*} pieces=${case#*:}
    here=$work/$log-$pieces
    [ -d "$work/$log" ] || "$program" map -q "$data/$log.clf.bz2" -o "$work/$log"
    for deal in "" --alternate; do
        rm -rf "$here"
        "$program" cut -q "$data/$log.clf.bz2" --pieces "$pieces" $deal -o "$here/logs"
        "$program" map --json "$here"/logs/*.clf -o "$here/out" > "$here/metrics.json"
        islands=$(python3 -c "import json; m = json.load(open('$here/metrics.json')); print(len(m['islands']))")
        echo "== $log in $pieces ${deal:-, overlaps in both}: $islands island(s)"
        score() { "$program" eval relations --relations "$data/$log.relations" "$@" | grep '^across'; }
        echo "team   $(score --traj "$here"/out/*.tum)"
        echo "single $(score --traj "$work/$log/$log.tum" --across-of "$here"/out/*.tum)"
    done
done
