#!/bin/sh
# Writes the synthetic stress logs, maps each with and without odometry, prints the table of run.py.
#   bench/stress/run.sh [FOLDER]
set -eu
cargo build --release -p manifoldslam
cargo build --release -p manifoldslam-synthetic --example stress_logs
target=${CARGO_TARGET_DIR:-target}
folder=${1:-$target/stress}
"$target/release/examples/stress_logs" "$folder/logs"
exec python3 "$(dirname "$0")/run.py" "$folder/logs" "$folder/maps" --binary "$target/release/manifoldslam"
