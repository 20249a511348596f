#!/bin/sh
# Time by stage for a quarter, a half and all of each log, and repeatability; see growth.py.
#   bench/slam/growth.sh [LOGS] [OUT]
set -eu
cargo build --release -p manifoldslam
target=${CARGO_TARGET_DIR:-target}
exec python3 "$(dirname "$0")/growth.py" "$target/release/manifoldslam" \
    "${1:-../shared/data/laser-logs}" "${2:-$target/growth}"
