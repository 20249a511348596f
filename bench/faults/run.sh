#!/usr/bin/env bash
# Writes logs in which robots' data go bad, maps them and says what was noticed.
#
# usage: bench/faults/run.sh [FIRST_SEED [COUNT]]
set -euo pipefail
cargo build --release --locked --quiet
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo run --release --locked --quiet -p manifoldslam-synthetic --example mishaps -- \
    "$work/logs" "${1:-0}" "${2:-40}"
python3 bench/faults/run.py "$work/logs" "$work/out"
