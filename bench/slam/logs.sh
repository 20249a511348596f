#!/bin/sh
# The three logs, one configuration: accuracy against the truth's relations, wall time of the whole run (five
# runs, the program's own clock), stages of the last run, peak memory, closures, same bytes on 1 and 2 threads.
#   bench/slam/logs.sh [LOGS] [OUT]
set -eu
cargo build --release --quiet -p manifoldslam
target=${CARGO_TARGET_DIR:-target}
logs=${1:-../shared/data/laser-logs}
out=${2:-$target/logs}
program=$target/release/manifoldslam
mkdir -p "$out"
for log in intel aces mit-csail; do
    echo "== $log"
    for run in 1 2 3 4 5; do
        "$program" map "$logs/$log.clf.bz2" -o "$out/$log" --quiet --threads 2
        python3 -c "
import json; m = json.load(open('$out/$log/metrics.json')); t = m['times_secs']
print('run $run: %.2f s, %.0fx real time, peak %.0f MiB' % (t['total'], m['times_real_time'], m['peak_memory_mib']),
      *(('; ' + ', '.join(f'{k} {v:.2f}' for k, v in t.items() if k != 'total')) if $run == 5 else '',))"
    done
    "$program" eval relations --relations "$logs/$log.relations" --traj "$out/$log/$log.tum"
    python3 bench/slam/closures.py "$out/$log" "$log" "$logs/$log.relations"
    "$program" map "$logs/$log.clf.bz2" -o "$out/$log-1" --quiet --threads 1
    for file in $log.tum graph.g2o map.png; do
        cmp "$out/$log/$file" "$out/$log-1/$file" && echo "same bytes on 1 and 2 threads: $file"
    done
done
