#!/usr/bin/env python3
"""Loop closures of a result folder against the truth's relations.

usage: closures.py RESULT LOG_NAME RELATIONS

An edge of graph.g2o between patches more than 100 scans apart is a closure. The truth knows it when it has
a relation between scans within 15 scans of both ends; the short ways from there to the ends are taken
from the result's trajectory. A closure is wrong when it is more than 0.3 m or 6 degrees off, and
off by more than 3.4 standard deviations (99 %) of its own covariance.
All closures are drawn into RESULT-closures.svg: right ones green, unknown ones grey, wrong ones thick and red.
Recall: share of the truth's relations more than 100 scans apart with a closure within 15 scans of both ends,
or whose ends the map places within 0.3 m and 6 degrees of the truth without one ("placed").
"""
import csv, math, sys

NEAR, FAR = 15, 100


def between(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return (c * dx + s * dy, -s * dx + c * dy, wrap(b[2] - a[2]))


def times(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    return (a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap(a[2] + b[2]))


def wrap(a):
    return (a + math.pi) % (2 * math.pi) - math.pi


def off(e):
    return math.hypot(e[0], e[1]) > 0.3 or abs(e[2]) > math.radians(6)


def draw(path, poses, closures):
    """The trajectory and every closure, y up; wrong ones last, so that nothing hides them."""
    colours = {"unknown": ("#999", 0.05), "right": ("#2a2", 0.08), "wrong": ("#d00", 0.3)}
    xs, ys = [p[0] for p in poses], [-p[1] for p in poses]
    x, y = min(xs) - 1, min(ys) - 1
    box = f"{x:.1f} {y:.1f} {max(xs) + 1 - x:.1f} {max(ys) + 1 - y:.1f}"
    with open(path, "w") as file:
        file.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" width="1000">\n')
        points = " ".join(f"{a:.2f},{b:.2f}" for a, b in zip(xs, ys))
        file.write(f'<polyline points="{points}" fill="none" stroke="#bcd" stroke-width="0.05"/>\n')
        for a, b, verdict in sorted(closures, key=lambda c: list(colours).index(c[2])):
            colour, width = colours[verdict]
            file.write(f'<line x1="{xs[a]:.2f}" y1="{ys[a]:.2f}" x2="{xs[b]:.2f}" y2="{ys[b]:.2f}" '
                       f'stroke="{colour}" stroke-width="{width}"><title>{a} {b} {verdict}</title></line>\n')
        file.write("</svg>\n")


def main():
    folder, name, relations = sys.argv[1:4]
    poses, index = [], {}
    for line in open(f"{folder}/{name}.tum"):
        v = [float(x) for x in line.split()]
        index.setdefault(round(v[0] * 1e4), len(poses))
        poses.append((v[1], v[2], 2 * math.atan2(v[6], v[7])))
    scan = {int(r["patch"]): int(r["scan"]) for r in csv.DictReader(open(f"{folder}/patches.csv"))}
    truth = []
    for line in open(relations):
        v = [float(x) for x in line.split()]
        if len(v) < 8:
            continue
        ends = [next((index[round(t * 1e4) + d] for d in (0, -1, 1) if round(t * 1e4) + d in index), None)
                for t in v[:2]]
        if None not in ends and abs(ends[0] - ends[1]) > FAR:
            truth.append((ends[0], ends[1], (v[2], v[3], v[7])))
    known = wrong = total = 0
    closures, verdicts = [], []
    for line in open(f"{folder}/graph.g2o"):
        f = line.split()
        if f[0] != "EDGE_SE2":
            continue
        a, b = scan[int(f[1])], scan[int(f[2])]
        if abs(a - b) <= FAR:
            continue
        total += 1
        z, info = tuple(map(float, f[3:6])), list(map(float, f[6:12]))
        closures.append((a, b))
        best = None
        for p, q, t in truth:
            for p, q, t in ((p, q, t), (q, p, between(t, (0, 0, 0)))):
                d = abs(p - a) + abs(q - b)
                if abs(p - a) <= NEAR and abs(q - b) <= NEAR and (best is None or d < best[0]):
                    best = (d, p, q, t)
        verdicts.append((a, b, "unknown"))
        if best is None:
            continue
        verdicts[-1] = (a, b, "right")
        known += 1
        _, p, q, t = best
        true = times(times(between(poses[a], poses[p]), t), between(poses[q], poses[b]))
        e = between(true, z)
        chi2 = (info[0] * e[0] ** 2 + 2 * info[1] * e[0] * e[1] + 2 * info[2] * e[0] * e[2]
                + info[3] * e[1] ** 2 + 2 * info[4] * e[1] * e[2] + info[5] * e[2] ** 2)
        if off(e):
            verdict = "wrong" if chi2 > 11.34 else "within its covariance"
            wrong += chi2 > 11.34
            verdicts[-1] = (a, b, "wrong" if chi2 > 11.34 else "right")
            print(f"  scans {a} {b}: {math.hypot(e[0], e[1]):.2f} m {math.degrees(e[2]):.1f} deg off, {verdict}")
    met = sum(any((abs(p - a) <= NEAR and abs(q - b) <= NEAR) or (abs(q - a) <= NEAR and abs(p - b) <= NEAR)
                  for a, b in closures) for p, q, _ in truth)
    placed = sum(not off(between(t, between(poses[p], poses[q]))) for p, q, t in truth)
    draw(f"{folder}-closures.svg", poses, verdicts)
    print(f"{name}: {total} closures, {known} known to the truth, {wrong} wrong; truth's revisits {len(truth)}: "
          f"closed directly {met}, placed right {placed} ({100 * placed / max(1, len(truth)):.1f} %)")


main()
