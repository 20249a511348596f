#!/usr/bin/env bash
# Maps logs in which nothing happened to any robot and says what is left out of their maps all the same.
#
# usage: bench/faults/alarms.sh LOG...
set -euo pipefail
cargo build --release --locked --quiet
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for log in "$@"; do
    for odometry in on off; do
        target/release/manifoldslam map -q --odometry "$odometry" "$log" -o "$work/out" 2> "$work/told" || true
        count=$(grep -c '^warning: .*data went bad' "$work/told" || true)
        echo "$(basename "$log") odometry $odometry: $count"
        sed -n 's/^warning: [^:]*: data went bad at/    at/p' "$work/told"
    done
done
