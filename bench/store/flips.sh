#!/bin/sh
# Flips a bit of every byte of a small manifold file: each time the file is refused or is the same map bit by bit,
# and what is salvaged of a refused one is the same, or its loss is told.
#   bench/store/flips.sh
set -eu
cargo test --release --quiet -p manifoldslam-store --test oracles -- --ignored --show-output every_byte
