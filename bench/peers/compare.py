#!/usr/bin/env python3
"""Times and scores ours and the peers' matchers on the same pairs, interleaved; prints Markdown.

usage: compare.py PAIRS.txt ROUNDS PEER_PAIRS MRPT_ICP

PEER_PAIRS is the built example of that name, MRPT_ICP the built mrpt_icp.cpp, left out where there
is no such file. The pairs are cut into ROUNDS blocks; in each round every contestant matches one
block, in turning order. One core; CPU time, of each pair the fastest of seven runs (three where a
run takes 2 ms).
"""

import gc
import os
import subprocess
import sys
import time

import adapters
import pairs as pair_file
import report

LONG_NS, REPEATS, LONG_REPEATS = 2e6, 7, 3


class Result:
    """What one contestant made of one pair; times in microseconds."""

    def __init__(self, pose, align, build, update=float("nan")):
        self.pose, self.align, self.build, self.update = pose, align, build, update


class InProcess:
    """A peer from adapters.py."""

    def __init__(self, adapter):
        self.adapter = adapter
        self.name = adapter.name

    def run(self, pairs):
        return {pair.index: self.one(pair) for pair in pairs}

    def one(self, pair):
        def build():
            return self.adapter.prepare(pair.reference), self.adapter.load(pair.scan)

        (reference, scan), built = fastest(build)
        pose, aligned = fastest(lambda: self.adapter.align(reference, scan, pair.guess))
        return Result(pose, aligned, built)


class Program:
    """A program that reads the pairs' file itself and prints a line for each pair."""

    def __init__(self, name, command):
        self.name = name
        self.command = command

    def run(self, pairs):
        span = [str(pairs[0].index), str(pairs[-1].index + 1)]
        done = subprocess.run(self.command + span, check=True, capture_output=True, text=True)
        results = {}
        for line in done.stdout.splitlines():
            index, *numbers = line.split()
            x, y, yaw, *times = map(float, numbers)
            results[int(index)] = Result(pair_file.Pose(x, y, yaw), *times)
        return results


def fastest(work):
    """What the work gives and its shortest CPU time, microseconds."""
    best, runs = float("inf"), 0
    while runs < (LONG_REPEATS if best > LONG_NS and runs else REPEATS):
        began = time.process_time_ns()
        result = work()
        best = min(best, time.process_time_ns() - began)
        runs += 1
    return result, best * 1e-3


def contestants(path, ours, mrpt):
    names = subprocess.run([ours, "list"], check=True, capture_output=True, text=True).stdout.split()
    found = [Program(f"ours: {name}", [ours, "time", path, name]) for name in names]
    if os.access(mrpt, os.X_OK):
        variants = ("classic", "decimated", "lm")
        found += [Program(f"MRPT CICP {v}", [mrpt, path, v]) for v in variants]
    found += map(InProcess, adapters.installed(lambda text: print(text, file=sys.stderr)))
    return found


def main():
    path, rounds, ours, mrpt = sys.argv[1:]
    rounds = int(rounds)
    os.sched_setaffinity(0, {int(os.environ.get("PEERS_CORE", "0"))})
    pairs = pair_file.read(path)
    everyone = contestants(path, ours, mrpt)
    results = {who.name: {} for who in everyone}
    blocks = [pairs[len(pairs) * k // rounds : len(pairs) * (k + 1) // rounds] for k in range(rounds)]
    blocks = [block for block in blocks if block]
    report.header(len(pairs), len(blocks))
    gc.disable()
    for k, block in enumerate(blocks):
        for who in list(everyone if k % 2 == 0 else everyone[::-1]):
            print(f"round {k + 1} of {len(blocks)}: {who.name}", file=sys.stderr)
            try:
                results[who.name].update(who.run(block))
            except (RuntimeError, ValueError, TypeError, subprocess.CalledProcessError) as error:
                if who.name == report.REFERENCE:
                    raise
                print(f"{who.name}: left out, {error}", file=sys.stderr)
                everyone.remove(who)
                del results[who.name]
        gc.collect()
    report.print_all(blocks, results)


main()
