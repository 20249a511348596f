#!/usr/bin/env bash
# Maps teams of 1, 2, 4, ... robots, 300 m each, on a campus with known truth, and tells what that
# takes and how right it is. The last columns are CPU time beside that of as many single robots, and
# beside as many pairs.
#
# usage: bench/team/campus.sh [SEED [ROBOTS...]]
set -euo pipefail
seed=${1:-1}
shift || true
teams=("${@:-}")
[ -n "${teams[0]}" ] || teams=(1 2 4 8 16 32 64)
cargo build --release --locked --quiet
cargo build --release --locked --quiet -p manifoldslam-synthetic --example campus
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat > "$work/row.py" <<'PYTHON'
import json, resource, subprocess, sys, time
robots, work = int(sys.argv[1]), sys.argv[2]
logs = [f"{work}/logs/robot-{k:02}.clf" for k in range(robots)]
program = "target/release/manifoldslam"
before = time.time()
told = subprocess.run([program, "map", "--json", *logs, "-o", f"{work}/out"], stdout=subprocess.PIPE,
                      stderr=subprocess.DEVNULL, check=True)
wall = time.time() - before
used = resource.getrusage(resource.RUSAGE_CHILDREN)
cpu = used.ru_utime + used.ru_stime
m = json.loads(told.stdout)
names = m["islands"][0]["robots"]
for ending, files in (("tum", [f"{work}/out/{n}.tum" for n in names]),
                      ("truth", [f"{work}/logs/{n}.truth.tum" for n in names])):
    with open(f"{work}/all.{ending}", "wb") as out:
        for name in files:
            out.write(open(name, "rb").read())
told = subprocess.run([program, "eval", "ate", "--json", "--truth", f"{work}/all.truth", "--traj",
                       f"{work}/all.tum"], stdout=subprocess.PIPE, check=True)
ate = json.loads(told.stdout)
counts, times = m["map"]["counts"], m["times_secs"]
path = f"{sys.argv[3]}"
try:
    firsts = json.load(open(path))
except FileNotFoundError:
    firsts = {}
firsts[str(robots)] = cpu
json.dump(firsts, open(path, "w"))
ratio = lambda of: f"{cpu / (firsts[of] * robots / int(of)):.2f}" if of in firsts else "-"
stage = lambda *names: f"{sum(times.get(n, 0) for n in names):.2f}"
print("|", " | ".join([
    str(robots), str(counts["scans"]), str(counts["patches"]), f"{wall:.2f}", f"{cpu:.2f}",
    stage("merging"), stage("optimisation"), stage("refit", "relocalisation"), stage("rendering"),
    f"{m['peak_memory_mib']:.0f}", str(counts["closures"]["tried"]), str(counts["places_compared"]),
    str(len(m["islands"])), str(len(names)), f"{ate['trans_rmse_m']:.4f}", f"{ate['trans_max_m']:.3f}",
    f"{ate['rot_rmse_deg']:.3f}", ratio("1"), ratio("2")]), "|", flush=True)
PYTHON
echo "seed $seed; times in seconds; merging, optimisation, refit, rendering are wall-clock shares"
echo "| robots | scans | patches | wall | CPU | merging | optimisation | refit | rendering | MiB |" \
    "closures tried | places compared | islands | robots on the first | ATE m | worst m | ATE deg | x 1 | x 2 |"
echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
for robots in "${teams[@]}"; do
    rm -rf "$work/logs" "$work/out"
    target/release/examples/campus "$work/logs" "$robots" "$seed" > "$work/logs.txt"
    python3 "$work/row.py" "$robots" "$work" "$work/cpu.json"
done
