#!/usr/bin/env python3
"""The peers' settings that were tried, on pairs that are not scored.

usage: trials.py PAIRS.txt [PEER...]

PAIRS.txt is what `peer_pairs write PAIRS.txt 60 90000` writes; with PEERs only settings of these
packages are tried. Prints for each setting and task: median time of match and building, median
errors, failures, error over the bound. Pin it to a core; times are of one run each.
"""

import importlib
import statistics
import sys
import time

import adapters
import pairs as pair_file
import report
from adapters import Karto, KissIcp, Open3d, SmallGicp

# Gates (with iterations) that more than one trial has.
THREE = [(1.0, 10), (0.3, 10), (0.1, 10)]
SHORT = [(1.0, 6), (0.3, 6), (0.1, 6)]
ONE = [(1.0, 20)]

TRIALS = [
    *(
        (SmallGicp, dict(kind="ICP", form="points", stages=stages))
        for stages in ([(1.0, 20), (0.3, 20), (0.1, 20)], [(1.0, 8), (0.3, 8), (0.1, 12)], [(1.0, 60)])
    ),
    *((SmallGicp, dict(kind="PLANE_ICP", stages=THREE, neighbours=n)) for n in (20, 40, 80)),
    (SmallGicp, dict(kind="PLANE_ICP", stages=[(1.0, 6), (0.3, 10)], neighbours=40)),
    *((SmallGicp, dict(kind="GICP", stages=SHORT, neighbours=n)) for n in (20, 40, 80)),
    (SmallGicp, dict(kind="GICP", stages=ONE, neighbours=40)),
    (SmallGicp, dict(kind="GICP", stages=SHORT, form="staggered", neighbours=20)),
    *((SmallGicp, dict(kind="VGICP", stages=ONE, voxel=0.5, neighbours=n)) for n in (20, 40, 80)),
    *((SmallGicp, dict(kind="VGICP", stages=ONE, voxel=v, neighbours=40)) for v in (0.3, 1.0)),
    (SmallGicp, dict(kind="VGICP", stages=[(1.0, 10), (0.3, 10)], voxel=0.5, neighbours=40)),
    *(
        (SmallGicp, dict(kind="VGICP", stages=ONE, voxel=0.5, form="staggered", neighbours=n))
        for n in (14, 20, 40)
    ),
    *(
        (KissIcp, dict(voxel=voxel, most=most, stages=stages))
        for voxel, most, stages in (
            (0.5, 100, [(1.0, 0.1)]),
            (0.5, 100, [(1.0, 0.3), (0.3, 0.05)]),
            (0.5, 100, [(1.0, 0.3), (0.2, 0.03)]),
            (0.5, 400, [(1.0, 0.3), (0.2, 0.03)]),
            (1.0, 100, [(1.0, 0.1)]),
            (1.0, 400, [(1.0, 0.3), (0.2, 0.03)]),
        )
    ),
    *(
        (Open3d, dict(kind="point-to-plane", stages=stages))
        for stages in ([(1.0, 0.1, 20)], [(1.0, 0.3, 10), (0.3, 0.05, 10)], [(1.0, 0.3, 6), (0.3, 0.03, 10)])
    ),
    *(
        (Open3d, dict(kind="generalized", stages=stages))
        for stages in ([(1.0, 6.0, 30)], [(1.0, 6.0, 10), (0.3, 1.0, 10)])
    ),
    (Karto, dict(search=0.3)),
    (Karto, dict(search=1.0)),
    (Karto, dict(search=1.0, smear=0.05)),
]


def main():
    path, *peers = sys.argv[1:]
    pairs = pair_file.read(path)
    for kind, settings in TRIALS:
        if peers and kind.package not in peers:
            continue
        try:
            adapter = kind(importlib.import_module(kind.package), **settings)
        except ImportError as error:
            print(f"{kind.package}: left out, {error}")
            continue
        print(kind.__name__, settings)
        for task in report.TASKS:
            attempt(adapter, [pair for pair in pairs if pair.task == task], task)


def attempt(adapter, pairs, task):
    found, align, build = {}, [], []
    for pair in pairs:
        began = time.process_time_ns()
        reference, scan = adapter.prepare(pair.reference), adapter.load(pair.scan)
        ready = time.process_time_ns()
        found[pair.index] = Found(adapter.align(reference, scan, pair.guess))
        align.append(time.process_time_ns() - ready)
        build.append(ready - began)
    middle, most, yaw, lost, (shift, turn) = report.scores(pairs, found)
    times = f"{statistics.median(align) * 1e-3:7.0f} + {statistics.median(build) * 1e-3:6.0f} us"
    errors = f"{1e3 * middle:6.2f} mm (95 % {1e3 * most:6.1f}) {57.29578 * yaw:.4f} deg, {lost} lost"
    print(f"    {task:9} {times} {errors}, {shift:.2f}, {turn:.2f} x the bound", flush=True)


class Found:
    """A pose as report.scores looks for it."""

    def __init__(self, pose):
        self.pose = pose


if __name__ == "__main__":
    main()
