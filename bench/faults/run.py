#!/usr/bin/env python3
"""Maps logs in which a robot's data go bad and says what was noticed. Standard library only.

    python3 bench/faults/run.py LOGS OUT [--binary B]

LOGS is the folder written by the mishaps example of the synthetic crate. Per kind of mishap and of world:

    noticed   runs whose map leaves scans out within 10 s of the mishap, or in it, of all runs
    late      runs in which something was left out only later
    false     runs with scans left out from before the mishap, or without any mishap
    delay     from the first bad scan to the first that is left out: mean, largest, seconds
    good      good scans that are left out all the same, mean per run noticed
    kept      bad scans that are left in the map, mean per run noticed
    joined    runs noticed whose good scans end on one island
    ate       root mean square distance from the truth of the scans on each island after alignment, good scans
              alone: median and largest over the runs, metres; `missed`: the same where nothing was noticed
"""
import argparse
import json
import math
import pathlib
import statistics
import subprocess


def read_tum(path):
    rows = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
    return {r[0]: (float(r[1]), float(r[2])) for r in rows}


def ate(pairs):
    """Of positions, after the best rigid alignment (Umeyama 1991 without scale)."""
    n = len(pairs)
    mean = lambda k, d: sum(p[k][d] for p in pairs) / n
    tx, ty, ex, ey = mean(0, 0), mean(0, 1), mean(1, 0), mean(1, 1)
    c = s = 0.0
    for (px, py), (qx, qy) in pairs:
        a, b, x, y = px - tx, py - ty, qx - ex, qy - ey
        c, s = c + x * a + y * b, s + x * b - y * a
    yaw = math.atan2(s, c)
    c, s, total = math.cos(yaw), math.sin(yaw), 0.0
    for (px, py), (qx, qy) in pairs:
        x, y = qx - ex, qy - ey
        total += (c * x - s * y - px + tx) ** 2 + (s * x + c * y - py + ty) ** 2
    return math.sqrt(total / n)


def run(case, logs, out, binary):
    log = logs / f"{case}.clf"
    folder = out / case
    subprocess.run([binary, "map", "--quiet", str(log), "-o", str(folder)], check=True, capture_output=True)
    told = json.loads((folder / "metrics.json").read_text())["logs"][0]
    rows = (logs / f"{case}.truth.tum").read_text().splitlines()
    stamps = [line.split()[0] for line in rows if line and line[0] != "#"]
    truth = read_tum(logs / f"{case}.truth.tum")
    kind = json.loads((logs / f"{case}.json").read_text())
    first, end = kind["bad"]
    bad = set(stamps[first:end])
    errors, left_in = [], 0
    for part in told["trajectories"]:
        poses = read_tum(folder / part["file"])
        left_in += sum(stamp in bad for stamp in poses)
        pairs = [(truth[s], p) for s, p in poses.items() if s not in bad]
        if pairs:
            errors.append(ate(pairs))
    left_out = [(b["first_scan"], b["first_scan"] + b["scans"]) for b in told["bad_data"]]
    secs = [float(s) for s in stamps]
    end_secs = secs[min(end, len(secs) - 1)]
    after = [a for a, _ in left_out if a >= first]
    return {
        **kind, "first": first,
        "noticed": any(secs[a] <= max(end_secs, secs[first] + 10) for a in after) if first < len(secs) else False,
        "late": bool(after), "false": any(a < first for a, _ in left_out),
        "delay": secs[min(after)] - secs[first] if after else None,
        "good": sum(i < first or i >= end for a, b in left_out for i in range(a, b)),
        "kept": left_in, "islands": len(told["trajectories"]), "ate": max(errors),
    }


def line(name, world, runs):
    noticed = [r for r in runs if r["noticed"]]
    missed = [r for r in runs if not r["noticed"]]
    late = sum(r["late"] and not r["noticed"] for r in runs)
    spread = lambda rows: f"{statistics.median(rows):7.3f} {max(rows):7.3f}" if rows else f"{'-':>7} {'-':>7}"
    mean = lambda rows: f"{statistics.mean(rows):6.1f}" if rows else f"{'-':>6}"
    delays = [r["delay"] for r in noticed]
    return (f"{name:12} {world:10} {len(noticed):3}/{len(runs):<3} {late:4} {sum(r['false'] for r in runs):5} |"
            f" {mean(delays)} {max(delays, default=0):6.1f} | {mean([r['good'] for r in noticed])}"
            f" {mean([r['kept'] for r in noticed])} | {sum(r['islands'] == 1 for r in noticed):3}/{len(noticed):<3} |"
            f" {spread([r['ate'] for r in noticed])} | {spread([r['ate'] for r in missed])}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--binary", default="target/release/manifoldslam")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    cases = sorted(p.stem for p in options.logs.glob("*.clf"))
    runs = [run(case, options.logs, options.out, options.binary) for case in cases]
    print("kind         world      noticed late false |  delay    max |   good   kept |  joined |"
          "   ate m     max |  missed     max")
    for name in ["none", "carried", "on-its-back", "on-its-side", "covered", "dead"]:
        for world in ["rooms", "look-alike"]:
            chosen = [r for r in runs if r["kind"] == name and r["world"] == world]
            if chosen:
                print(line(name, world, chosen))


main()
