#!/bin/sh
# Kills writers of manifold files at moments without a pattern, checks what they leave after every kill: the file
# opens, verifies, holds every step that was told to be on disk and at most one more, bit by bit.
#   bench/store/kill.sh [ROUNDS] [FOLDER]
set -eu
cargo build --release --quiet -p manifoldslam-store --example site_story
target=${CARGO_TARGET_DIR:-target}
folder=${2:-$target/store-kill}
rm -rf "$folder"
"$target/release/examples/site_story" kill "${1:-200}" "$folder"
rm -rf "$folder"
