#!/usr/bin/env bash
# How often, how well and how safely islands are joined by landmarks alone. Synthetic, geometry off.
#
# usage: bench/landmarks/run.sh [SEEDS]
set -euo pipefail
seeds=${1:-100}
cargo build --release --locked --quiet -p manifoldslam-slam --examples
echo "# example landmark_teams 0 $seeds: two robots map a building, landmarks alone join their islands"
target/release/examples/landmark_teams 0 "$seeds"
echo
echo "# example landmarks $((5 * seeds)): two islands of tags, each seen once, without scans"
target/release/examples/landmarks "$((5 * seeds))"
