#!/usr/bin/env python3
"""Batch optimisation beside GTSAM: same files, same start, same run, one core, interleaved.

usage: compare.py VENV BATCH REPEATS GRAPH.g2o...

VENV is a folder for GTSAM's virtual environment, made if missing (PyPI gtsam 4.3.0).
BATCH is the built example `batch` of the optimizer crate.
Each round runs ours and both of GTSAM's optimisers once, each in a process of its own pinned to
core 0. Times are CPU time from the graph in memory to the answer; ours has the symbolic analysis
in it, GTSAM's its ordering. chi2 is the sum of squared Mahalanobis residuals (twice GTSAM's error),
of which GTSAM's own and ours agree on the start, so it is one definition.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile

WORKER = r"""
import json, resource, sys
import gtsam

def cpu():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime

method, path = sys.argv[1:]
graph, start = gtsam.readG2o(path, False)
key = min(start.keys())
held = gtsam.NonlinearFactorGraph(graph)
held.add(gtsam.PriorFactorPose2(key, start.atPose2(key), gtsam.noiseModel.Diagonal.Sigmas([1e-6] * 3)))
before = cpu()
if method == "gn":
    optimizer = gtsam.GaussNewtonOptimizer(held, start, gtsam.GaussNewtonParams())
else:
    optimizer = gtsam.LevenbergMarquardtOptimizer(held, start, gtsam.LevenbergMarquardtParams())
result = optimizer.optimize()
elapsed = cpu() - before
print(json.dumps({
    "ms": 1e3 * elapsed,
    "iterations": optimizer.iterations(),
    "start": 2 * graph.error(start),
    "chi2": 2 * graph.error(result),
}))
"""


def environment(folder):
    python = os.path.join(folder, "bin", "python")
    if not os.path.exists(python):
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "-q", "install", "gtsam==4.3.0", "numpy"], check=True)
    return python


def pinned(command):
    single = dict(os.environ, OMP_NUM_THREADS="1", TBB_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    done = subprocess.run(["taskset", "-c", "0"] + command, check=True, env=single, capture_output=True, text=True)
    return done.stdout


def ours(batch, path):
    words = pinned([batch, path]).split()[1:]
    fields = dict(zip(words[::2], map(float, words[1::2])))
    return {
        "ms": fields["cold_ms"],
        "warm": fields["warm_ms"],
        "iterations": int(fields["iterations"]),
        "start": fields["start_chi2"],
        "chi2": fields["chi2"],
        "ate": fields.get("ate_m"),
    }


def main():
    folder, batch, repeats, *graphs = sys.argv[1:]
    python = environment(folder)
    with tempfile.TemporaryDirectory() as scratch:
        worker = os.path.join(scratch, "worker.py")
        with open(worker, "w") as file:
            file.write(WORKER)
        for path in graphs:
            rounds = {"ours": [], "GTSAM GN": [], "GTSAM LM": []}
            for _ in range(int(repeats)):
                rounds["ours"].append(ours(batch, path))
                for name, method in (("GTSAM GN", "gn"), ("GTSAM LM", "lm")):
                    rounds[name].append(json.loads(pinned([python, worker, method, path])))
            report(os.path.basename(path), rounds)


def report(name, rounds):
    print(name)
    middle = {who: statistics.median(r["ms"] for r in runs) for who, runs in rounds.items()}
    for who, runs in rounds.items():
        last = runs[-1]
        fastest = min(r["ms"] for r in runs)
        line = f"  {who:9} {middle[who]:9.2f} ms median {fastest:9.2f} best, {last['iterations']} iterations, "
        line += f"chi2 {last['start']:.6g} -> {last['chi2']:.9f}"
        if "warm" in last:
            warm = statistics.median(r["warm"] for r in runs)
            line += f", known structure {warm:.2f} ms"
        if last.get("ate") is not None:
            line += f", ATE {last['ate']:.4f} m"
        print(line)
    for who in ("GTSAM GN", "GTSAM LM"):
        print(f"  {who} takes {middle[who] / middle['ours']:.2f} times as long")


main()
