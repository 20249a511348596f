#!/bin/sh
# Maps logs, writes their manifold files as it goes, and says what that takes: time, bytes, opening, verifying.
#   bench/store/size.sh [LOGS] [FOLDER]
set -eu
cargo build --release --quiet -p manifoldslam-store --example site_size
target=${CARGO_TARGET_DIR:-target}
logs=${1:-../shared/data/laser-logs}
folder=${2:-$target/store-size}
rm -rf "$folder"
mkdir -p "$folder"
for log in intel aces mit-csail; do
    for every in 256 32; do
        echo "== $log, $every changes and scans a step"
        "$target/release/examples/site_size" "$logs/$log.clf.bz2" "$folder/$log-$every.manifold" $every
    done
done
rm -rf "$folder"
