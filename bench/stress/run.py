#!/usr/bin/env python3
"""Maps the synthetic stress logs and scores them against their truth. Standard library only.

    python3 bench/stress/run.py LOGS OUT [--binary B] [--threads N] [NAME]...

LOGS is the folder written by the stress_logs example of the synthetic crate. Every log is mapped twice: with
the configuration untouched, and without odometry. One line per run:

    local   error of relations between successive key scans, mean m / deg
    all     error of all relations, loop revisits included: mean m / deg, 95 %, largest
    first   first scan after which a local relation is off by more than 0.3 m or 6 degrees
    wrong   closures that hold in graph.g2o but contradict the truth by more than 0.3 m or 0.1 rad and five of
            their own standard deviations (a corridor leaves its axis open, and says so), of all relations
            between patches 30 s apart
    ate     root mean square distance from the truth after alignment
"""
import argparse
import json
import math
import pathlib
import subprocess

REASONS = ["not_found", "ambiguous", "poor_fit", "seen_through", "implausible", "unsupported"]


def wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def between(a, b):
    dx, dy, c, s = b[0] - a[0], b[1] - a[1], math.cos(a[2]), math.sin(a[2])
    return c * dx + s * dy, c * dy - s * dx, wrap(b[2] - a[2])


def read_tum(path):
    rows = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
    pose = lambda r: (float(r[1]), float(r[2]), 2 * math.atan2(float(r[6]), float(r[7])))
    return [(round(float(r[0]) * 1e4), pose(r)) for r in rows]


def relation_errors(path, poses, index):
    """[(first scan, later scan, translational error, rotational error in degrees, is local)]"""
    errors = []
    for line in path.read_text().splitlines():
        v = [float(x) for x in line.split()]
        keys = [round(v[0] * 1e4), round(v[1] * 1e4)]
        if any(k not in poses for k in keys):
            continue
        e = between(poses[keys[0]], poses[keys[1]])
        i, j = index[keys[0]], index[keys[1]]
        turned = abs(wrap(e[2] - v[7]))
        error = math.hypot(e[0] - v[2], e[1] - v[3])
        errors.append((i, j, error, math.degrees(turned), v[1] - v[0] < 29))
    return errors


def ate(truth, estimate):
    n = len(truth)
    tx, ty = sum(p[0] for p in truth) / n, sum(p[1] for p in truth) / n
    ex, ey = sum(p[0] for p in estimate) / n, sum(p[1] for p in estimate) / n
    c = s = 0.0
    for t, e in zip(truth, estimate):
        a, b, x, y = t[0] - tx, t[1] - ty, e[0] - ex, e[1] - ey
        c, s = c + x * a + y * b, s + x * b - y * a
    yaw = math.atan2(s, c)
    c, s, total = math.cos(yaw), math.sin(yaw), 0.0
    for t, e in zip(truth, estimate):
        x, y = e[0] - ex, e[1] - ey
        total += (c * x - s * y - t[0] + tx) ** 2 + (s * x + c * y - t[1] + ty) ** 2
    return math.sqrt(total / n)


def mahalanobis(e, i):
    """e^T I e with the upper triangle of I."""
    x, y, z = e
    return (i[0] * x * x + i[3] * y * y + i[5] * z * z
            + 2 * (i[1] * x * y + i[2] * x * z + i[4] * y * z))


def wrong_closures(folder, truth):
    """Closures that hold in the graph against the truth: [(scan, scan, metres, radians)], and their number."""
    rows = [line.split(",") for line in (folder / "patches.csv").read_text().splitlines()]
    scan_of = {int(row[0]): int(row[1]) for row in rows[1:]}
    secs = {int(row[0]): float(row[2]) for row in rows[1:]}
    wrong, closures = [], 0
    for line in (folder / "graph.g2o").read_text().splitlines():
        f = line.split()
        if not f or f[0] != "EDGE_SE2" or abs(secs[int(f[1])] - secs[int(f[2])]) < 30:
            continue
        a, b = scan_of[int(f[1])], scan_of[int(f[2])]
        e = between(tuple(map(float, f[3:6])), between(truth[a], truth[b]))
        closures += 1
        far = math.hypot(e[0], e[1]) > 0.3 or abs(e[2]) > 0.1
        if far and mahalanobis(e, list(map(float, f[6:12]))) > 25:
            wrong.append((a, b, math.hypot(e[0], e[1]), e[2]))
    return wrong, closures


def run(name, logs, out, odometry, options):
    folder = out / f"{name}-{'on' if odometry else 'off'}"
    command = ["nice", "-n", "10", options.binary, "map", "--quiet", str(logs / f"{name}.clf"),
               "-o", str(folder)]
    command += [] if odometry else ["--odometry", "off"]
    command += ["--threads", str(options.threads)] if options.threads else []
    done = subprocess.run(command, capture_output=True, text=True)
    if not (folder / "metrics.json").exists():
        return f"{name:10} FAILED ({done.returncode}): {done.stderr.strip()[:200]}", []
    metrics = json.loads((folder / "metrics.json").read_text())
    estimate = read_tum(next(folder.glob("*.tum")))
    truth = read_tum(logs / f"{name}.truth.tum")
    index = {key: i for i, (key, _) in enumerate(truth)}
    errors = relation_errors(logs / f"{name}.relations", dict(estimate), index)
    local = [e for e in errors if e[4]]
    mean = lambda rows, k: sum(r[k] for r in rows) / max(len(rows), 1)
    far = sorted(e[2] for e in errors)
    first = min((e[0] for e in local if e[2] > 0.3 or e[3] > 6), default=None)
    truth_of, poses = dict(truth), [p for _, p in estimate]
    true_poses = [truth_of[k] for k, _ in estimate]
    wrong, closures = wrong_closures(folder, true_poses)
    counts = metrics["map"]["counts"]
    tried = counts["closures"]
    text = (f"{name:10} {'on ' if odometry else 'off'} {len(poses):6}/{len(truth):<6}"
            f" {mean(local, 2):7.4f} {mean(local, 3):6.3f} |{mean(errors, 2):8.4f} {mean(errors, 3):6.3f}"
            f" {far[int(0.95 * (len(far) - 1))]:7.3f} {far[-1]:7.3f} | {ate(true_poses, poses):7.3f}"
            f" {'-' if first is None else first:>6} | {len(wrong):3}/{closures:<4}"
            f" {tried['tried']:5} {tried['accepted']:4} {tried['retracted']:3} "
            + " ".join(f"{tried[r]:4}" for r in REASONS)
            + f" | {counts['patches']:5} {counts['recoveries']:5} {counts['poor_fits']:5}"
            f" {len(poses) / metrics['times_secs']['total']:7.0f}")
    return text, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--binary", default="target/release/manifoldslam")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--odometry", choices=["on", "off", "both"], default="both")
    parser.add_argument("--wrong", action="store_true", help="list the wrong closures")
    options = parser.parse_intermixed_args()
    names = options.names or sorted(p.stem for p in options.logs.glob("*.clf"))
    print("log        odo  scans/true    local m    deg |   all m    deg     p95     max |   ate m"
          "  first | wrong/held tried  acc ret  n.f. amb. poor thru impl unsp | patch recov  poor scans/s")
    for odometry in [True, False]:
        if options.odometry != "both" and odometry != (options.odometry == "on"):
            continue
        for name in names:
            text, wrong = run(name, options.logs, options.out, odometry, options)
            print(text, flush=True)
            for a, b, metres, turn in wrong if options.wrong else []:
                print(f"    wrong closure: scan {a} -> {b}, {metres:.2f} m, {turn:.2f} rad")


main()
