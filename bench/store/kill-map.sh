#!/bin/sh
# Kills `map`, then `map --onto` on what is left, at moments without a pattern; after every kill the manifold file must
# open and replay to the same map. In the end each run is allowed to finish: its trajectories must be those of a run
# that was never killed, byte by byte.
#   bench/store/kill-map.sh LOGS... [-- KILLS FOLDER]
set -eu
logs=
while [ $# -gt 0 ] && [ "$1" != -- ]; do
    logs="$logs $1"
    shift
done
[ $# -gt 0 ] && shift
cargo build --release --quiet -p manifoldslam
target=${CARGO_TARGET_DIR:-target}
program=$target/release/manifoldslam
kills=${1:-200}
folder=${2:-$target/kill-map}
rm -rf "$folder"
mkdir -p "$folder"
start=$(date +%s%N)
"$program" map $logs -o "$folder/whole" --quiet
longest_ms=$((($(date +%s%N) - start) / 1000000))
sums() { (cd "$1" && cat ./*.tum | sha256sum); }
expected=$(sums "$folder/whole")

# A number below $1, the same in every run of this script.
state=20061126
below() {
    state=$(((state * 1103515245 + 12345) % 2147483648))
    echo $((state / 7 % $1))
}

# Runs a command and kills it after some time; false when it was quicker.
kill_one() {
    "$program" "$@" --quiet 2>"$folder/errors" &
    pid=$!
    sleep "$(awk "BEGIN { print $(below "$longest_ms") / 1000 }")"
    if kill -9 "$pid" 2>/dev/null; then
        wait "$pid" 2>/dev/null && return 1
        return 0
    fi
    wait "$pid" || { cat "$folder/errors"; exit 1; }
    return 1
}

killed=0 killed_onto=0 without_file=0 finished=0 quicker=0
while [ $((killed + killed_onto)) -lt "$kills" ]; do
    out=$folder/out
    site=$out/site.manifold
    rm -rf "$out"
    if kill_one map $logs -o "$out"; then killed=$((killed + 1)); else quicker=$((quicker + 1)); fi
    if [ ! -e "$site" ]; then
        without_file=$((without_file + 1))
        continue
    fi
    for _ in 1 2; do
        "$program" info --verify "$site" --quiet || { echo "FAILED: does not verify after $killed + $killed_onto kills"; exit 1; }
        if kill_one map $logs --onto "$site"; then killed_onto=$((killed_onto + 1)); else quicker=$((quicker + 1)); fi
    done
    "$program" info --verify "$site" --quiet || { echo "FAILED: does not verify after $killed + $killed_onto kills"; exit 1; }
    "$program" map $logs --onto "$site" --quiet 2>"$folder/errors" || { cat "$folder/errors"; exit 1; }
    found=$(sums "$out")
    [ "$found" = "$expected" ] || { echo "FAILED: another map after $killed + $killed_onto kills"; exit 1; }
    finished=$((finished + 1))
done
echo "map killed $killed times, map --onto $killed_onto times, within $longest_ms ms"
echo "every file verified; $without_file kills came before there was a file, $quicker runs were quicker than the kill"
echo "$finished runs allowed to finish: trajectories byte by byte those of a run never killed"
rm -rf "$folder"
