#!/usr/bin/env python3
"""How the time of a run grows with the log, and whether runs repeat byte by byte. Standard library only.

    python3 bench/slam/growth.py BINARY LOGS OUT [--repeats N] [--threads N]

LOGS holds NAME.clf.bz2. Every log is cut after a quarter, a half and all of its scans (lines); each piece is
mapped N times and the fastest run counts. Then each whole log is mapped twice with one and twice with two threads,
and the SHA-256 of the trajectory, the graph and the picture are compared.
"""
import argparse
import bz2
import hashlib
import json
import pathlib
import subprocess

NAMES = ["intel", "aces", "mit-csail"]
STAGES = ["reading", "waiting", "lines", "localisation", "loop-closing", "optimisation", "refit",
          "relocalisation", "rendering", "total"]


def pieces(log, folder):
    """Writes the log's first quarter, half and whole, in scans; yields (share, path)."""
    lines = bz2.open(log, "rb").readlines()
    scans = [i for i, line in enumerate(lines) if b"LASER" in line[:12]]
    for share in [0.25, 0.5, 1.0]:
        last = scans[max(0, round(share * len(scans)) - 1)]
        path = folder / f"{log.name.split('.')[0]}-{share:g}.clf"
        path.write_bytes(b"".join(lines[:last + 1]))
        yield share, path


def run(binary, log, out, threads):
    subprocess.run([binary, "map", "--quiet", "--threads", str(threads), str(log), "-o", str(out)], check=True)
    return json.loads((out / "metrics.json").read_text())


def growth(options, folder):
    print(f"\n| log | scans | patches | times real time | " + " | ".join(STAGES) + " | us per scan |")
    print("|---" * (len(STAGES) + 5) + "|")
    for name in NAMES:
        for share, piece in pieces(options.logs / f"{name}.clf.bz2", folder):
            runs = [run(options.binary, piece, folder / "map", options.threads) for _ in range(options.repeats)]
            best = min(runs, key=lambda m: m["times_secs"]["total"])
            times, scans = best["times_secs"], best["logs"][0]["scans"]
            stages = " | ".join(f"{1e3 * times.get(stage, 0):.0f}" for stage in STAGES)
            print(f"| {name} x {share:g} | {scans} | {best['map']['counts']['patches']} | "
                  f"{best['times_real_time']:.0f} | {stages} | {1e6 * times['total'] / scans:.0f} |", flush=True)


def hashes(out):
    files = sorted([*out.glob("*.tum"), out / "graph.g2o", out / "map.png"])
    return {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def determinism(options, folder):
    print("\n| log | file | SHA-256 | 1, 1, 2, 2 threads |\n|---|---|---|---|")
    for name in NAMES:
        found = []
        for threads in [1, 1, 2, 2]:
            run(options.binary, options.logs / f"{name}.clf.bz2", folder / "map", threads)
            found.append(hashes(folder / "map"))
        for file, digest in found[0].items():
            same = all(h.get(file) == digest for h in found)
            print(f"| {name} | {file} | {digest[:16]} | {'identical' if same else 'DIFFERENT'} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("binary")
    parser.add_argument("logs", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print(f"Milliseconds by stage, fastest of {options.repeats} runs, {options.threads} threads; "
          "`reading` runs beside the mapping.")
    growth(options, options.out)
    determinism(options, options.out)


main()
