#!/bin/sh
# Writes the synthetic stress logs in several variants, maps each with odometry, those of variant 0 also without,
# and prints the tables of run.py.
#   bench/stress/run.sh [FOLDER] [VARIANT]...
set -eu
cargo build --release -p manifoldslam
cargo build --release -p manifoldslam-synthetic --example stress_logs
target=${CARGO_TARGET_DIR:-target}
folder=${1:-$target/stress}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- 0 1 2 3 4
for variant in "$@"; do
    "$target/release/examples/stress_logs" "$folder/$variant/logs" "$variant" > /dev/null
    echo "variant $variant"
    odometry=on
    [ "$variant" != 0 ] || odometry=both
    python3 "$(dirname "$0")/run.py" "$folder/$variant/logs" "$folder/$variant/maps" \
        --binary "$target/release/manifoldslam" --odometry $odometry
done
