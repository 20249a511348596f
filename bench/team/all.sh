#!/usr/bin/env bash
# Every row of what many robots must show, one after the other, on the tree as it is. Takes about an
# hour on two cores.
#
# usage: bench/team/all.sh [DATA [ROW...]]
#   DATA holds laser-logs/ and pose-graphs/; rows: cuts outliers strangers twins landmarks storeys
#   retraction campus kills flips mishaps
set -euo pipefail
data=${1:-../shared/data}
shift || true
rows=("$@")
[ $# -gt 0 ] || rows=(campus retraction cuts strangers outliers kills flips landmarks storeys mishaps twins)
cargo build --release --locked --quiet
cargo build --release --locked --quiet --examples -p manifoldslam-slam -p manifoldslam-optimizer
program=target/release/manifoldslam
examples=target/release/examples
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

row() {
    case $1 in
    cuts) bench/team/cuts.sh "$data/laser-logs" ;;
    outliers) $examples/two_robots "$data/pose-graphs/csail-two-robots" 20 ;;
    strangers)
        for team in "intel mit-csail" "aces intel mit-csail"; do
            rm -rf "$work/out"
            # shellcheck disable=SC2086
            $program map $(printf "$data/laser-logs/%s.clf.bz2 " $team) -o "$work/out" | grep -E 'island|merged'
        done ;;
    twins) for family in rooms corridors mirrored; do $examples/twins 1000 500 $family 2; $examples/twins 1000 200 $family 1; done ;;
    landmarks) bench/landmarks/run.sh 100 ;;
    storeys) bench/levels/storeys.sh ramp 1..20 ;;
    retraction) $examples/retraction 18 200 20 1 ;;
    campus) bench/team/campus.sh ;;
    kills)
        $program cut -q "$data/laser-logs/intel.clf.bz2" --pieces 6 -o "$work/intel"
        bench/store/kill-map.sh "$work/intel/intel-1.clf" "$work/intel/intel-2.clf" -- 200 "$work/kills" ;;
    flips) bench/store/flips.sh ;;
    mishaps) bench/faults/run.sh 0 40 ;;
    *) echo "no such row: $1" >&2; exit 2 ;;
    esac
}

echo "tree $(git describe --always --dirty), $(date -u +%F), $(nproc) cores"
for name in "${rows[@]}"; do
    echo
    echo "== $name"
    before=$(date +%s)
    row "$name"
    echo "($name took $(($(date +%s) - before)) s)"
done
