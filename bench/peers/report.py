"""The tables of compare.py."""

import importlib.metadata
import math
import os
import platform
import statistics
import subprocess
import time

import adapters

# Worse than this is a failure, metres and radians.
LOST = (0.1, math.radians(2))
REFERENCE = "ours: fast-field"
TASKS = {
    "scan": "Scan against one scan, 0.3 m and 10 degrees apart, from the identity; bound 2 I^-1",
    "submap": "Scan against six scans, from 0.3 m and 10 degrees; bound (1 + 1/6) I^-1",
    "tracking": "Scan against six scans, from 3 cm and 0.6 degrees; bound (1 + 1/6) I^-1",
}
HEAD = (
    "| matcher | match, us | with building, us | time / ours | with building / ours | median, mm | 95 %, mm "
    "| yaw, deg | lost | error / bound, mm, yaw |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
)


def print_all(blocks, results):
    """The tables and what to know of them; `header` is printed before the first match."""
    for task, title in TASKS.items():
        own = [[pair for pair in block if pair.task == task] for block in blocks]
        own = [block for block in own if block]
        if not own:
            continue
        print(f"\n## {title}\n\n{HEAD}")
        for name, found in results.items():
            print(row(name, own, found, results[REFERENCE]))
        updates = [found.update for found in (results[REFERENCE][p.index] for b in own for p in b)]
        print(f"\nAdding a scan's points to our kept field: median {statistics.median(updates):.1f} us.")
    notes()


def row(name, blocks, found, reference):
    pairs = [pair for block in blocks for pair in block]
    align = statistics.median(found[p.index].align for p in pairs)
    total = statistics.median(found[p.index].align + found[p.index].build for p in pairs)
    ratio = ratios(blocks, found, reference, lambda r: r.align)
    whole = ratios(blocks, found, reference, lambda r: r.align + r.build)
    middle, most, yaw, lost, efficiency = scores(pairs, found)
    return (
        f"| {name} | {align:.1f} | {total:.1f} | {ratio:.1f} | {whole:.1f} | {1e3 * middle:.2f} | {1e3 * most:.2f} "
        f"| {math.degrees(yaw):.4f} | {lost} of {len(pairs)} | {efficiency[0]:.2f}, {efficiency[1]:.2f} |"
    )


def ratios(blocks, found, reference, time_of):
    """Median over the rounds of the ratio of the rounds' median times."""

    def middle(results, block):
        return statistics.median(time_of(results[pair.index]) for pair in block)

    return statistics.median(middle(found, block) / middle(reference, block) for block in blocks)


def scores(pairs, found):
    """Median and 95 % distance, median turn, failures, RMSE of the others over the bound's."""
    errors = [pair.error(found[pair.index].pose) for pair in pairs]
    # An answer that the matcher itself disowns is as far off as can be.
    errors = [e if all(map(math.isfinite, e)) else (math.inf, math.inf) for e in errors]
    inside = [(e, p.bound) for e, p in zip(errors, pairs) if e[0] <= LOST[0] and e[1] <= LOST[1]]
    bounded = [(e, b) for e, b in inside if all(map(math.isfinite, b))]
    distances, turns = sorted(e[0] for e in errors), sorted(e[1] for e in errors)
    efficiency = [math.nan, math.nan]
    if bounded:
        for k in (0, 1):
            squares = sum(e[k] ** 2 for e, _ in bounded)
            efficiency[k] = math.sqrt(squares / sum(b[k] for _, b in bounded))
    most = distances[math.ceil(0.95 * len(distances)) - 1]
    return statistics.median(distances), most, statistics.median(turns), len(errors) - len(inside), efficiency


def header(pairs, rounds):
    print("# Matchers beside others'\n")
    print(f"{time.strftime('%Y-%m-%d')}, {processor()}, {os.cpu_count()} cores, {system()}, {memory()}, load ", end="")
    print(", ".join(f"{load:.1f}" for load in os.getloadavg()) + f", tree {tree()}, {compiler()}\n")
    print(f"    bench/peers/run.sh {pairs // len(TASKS)} {rounds}\n")
    versions = [f"Python {platform.python_version()}"]
    for package in ("numpy", "small_gicp", "kiss-icp", "open3d", "karto-scanmatcher"):
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{package} not installed")
    mrpt = told(["dpkg-query", "-W", "-f", "${Version}", "libmrpt-slam-dev"])
    print(", ".join(versions + [f"MRPT {mrpt or 'not installed'}"]) + ".")


def notes():
    print(
        "\nOne thread; CPU time, of each pair the fastest of seven runs (three above 2 ms), median over the pairs. "
        "The rounds interleave all\ncontestants over a block of pairs; a ratio is the median over the rounds of the "
        "ratio of medians. \"With building\" begins with points\n(ours: with readings) and includes trees, voxels, "
        "covariances, fields; layers, 2D normals and 2D covariances for the peers are made by\nus and not charged. Our "
        "matchers by name build trees and grids inside the match, `fast-field` has its field before it. Peers called\n"
        "from Python pay a few microseconds a call. Lost: more than 0.1 m or 2 degrees off, or disowned by the matcher "
        "itself (ours only).\nError / bound: RMSE of those not lost over the root of the mean bound.\n"
    )
    for package, text in adapters.NOTES.items():
        print(f"- {package}: {text}.")
    print("- MRPT: gates from 0.75 to 0.05 m, at most 100 iterations, the cheap covariance; decimated: every 5th point.")


def told(command):
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def tree():
    return told(["git", "rev-parse", "--short", "HEAD"]) + ("+" if told(["git", "status", "--porcelain"]) else "")


def compiler():
    return " ".join(told(["rustc", "--version"]).split()[:2])


def processor():
    facts = {}
    for line in lines("/proc/cpuinfo"):
        name, _, value = line.partition(":")
        facts.setdefault(name.strip(), value.strip())
    name = facts.get("model name", platform.machine())
    return f"{name} family {facts['cpu family']} model {facts['model']}" if "cpu family" in facts else name


def memory():
    kib = [int(line.split()[1]) for line in lines("/proc/meminfo") if line.startswith("MemTotal")]
    return f"{kib[0] / 2**20:.0f} GiB" if kib else "memory unknown"


def system():
    names = [line.split("=")[1].strip('"') for line in lines("/etc/os-release") if line.startswith("PRETTY_NAME")]
    return names[0] if names else platform.system()


def lines(path):
    try:
        with open(path) as file:
            return file.read().splitlines()
    except OSError:
        return []
