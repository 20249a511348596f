#!/bin/sh
# Our matchers beside others' on the same pairs of scans in the same run; prints Markdown.
#   bench/peers/run.sh [PAIRS] [ROUNDS]
# PEERS_VENV is the folder of the peers' virtual environment (default: peers-venv in cargo's target
# folder), PEERS_CORE the core that everything is pinned to (default: 0).
set -eu
here=$(dirname "$0")
pairs=${1:-200}
rounds=${2:-5}
cargo build --release --locked -q -p manifoldslam-matching --example peer_pairs
target=${CARGO_TARGET_DIR:-target}
venv=${PEERS_VENV:-$target/peers-venv}
work=$target/peers
mkdir -p "$work"

[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
for package in numpy==2.4.6 small_gicp==1.0.1 kiss-icp==1.3.0 open3d==0.20.0 karto-scanmatcher==1.0.0; do
    "$venv/bin/python" -m pip -q --disable-pip-version-check install "$package" > "$work/pip.txt" 2>&1 ||
        { echo "$package cannot be installed and is left out:"; tail -n 3 "$work/pip.txt"; } >&2
done

# MRPT comes from Debian: apt-get install libmrpt-slam-dev
mrpt=$work/mrpt_icp
rm -f "$mrpt"
if [ -e /usr/include/mrpt/slam/include/mrpt/slam/CICP.h ] && command -v c++ > /dev/null; then
    includes=-I/usr/include/eigen3
    for folder in /usr/include/mrpt/*/include; do includes="$includes -I$folder"; done
    # shellcheck disable=SC2086 # a list of words
    c++ -O3 -march=native -std=c++17 $includes "$here/mrpt_icp.cpp" -o "$mrpt" -lmrpt-slam -lmrpt-maps \
        -lmrpt-obs -lmrpt-poses -lmrpt-math -lmrpt-config -lmrpt-system -lmrpt-rtti -lmrpt-core \
        > "$work/mrpt.txt" 2>&1 || echo "MRPT's program does not build and is left out: $work/mrpt.txt" >&2
else
    echo "MRPT is left out: no libmrpt-slam-dev or no C++ compiler" >&2
fi

"$target/release/examples/peer_pairs" write "$work/pairs.txt" "$pairs"
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 TBB_NUM_THREADS=1 RAYON_NUM_THREADS=1
exec "$venv/bin/python" "$here/compare.py" "$work/pairs.txt" "$rounds" \
    "$target/release/examples/peer_pairs" "$mrpt"
