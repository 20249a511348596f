"""The file that the example `peer_pairs` writes, and errors of the poses found in it."""

import math

import numpy as np

# Extruded clouds have a copy of each point at these heights, metres: libraries for 3D have no
# other way to see a vertical wall.
LAYERS = (-0.1, 0.0, 0.1)
# Normals are fitted to the point and this many neighbours on either side.
NEIGHBOURS = 6
# Neighbouring beams whose points are farther apart than this lie on different surfaces, metres.
JUMP = 0.4

# Variance of a wall across, beside 1 along it: what small_gicp and Open3D both use.
FLAT = 1e-3


class Pose:
    """A pose in the plane, target_from_source."""

    def __init__(self, x, y, yaw):
        self.x, self.y, self.yaw = x, y, yaw

    def matrix(self):
        m = np.eye(4)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        m[:2, :2] = ((c, -s), (s, c))
        m[:2, 3] = (self.x, self.y)
        return m

    @staticmethod
    def of_matrix(m):
        return Pose(m[0, 3], m[1, 3], math.atan2(m[1, 0], m[0, 0]))

    def __iter__(self):
        return iter((self.x, self.y, self.yaw))


class Cloud:
    """Points (z = 0), their normals in the plane, the same points otherwise, and the scans.

    `layers` has every point at every height, `staggered` each at one, in turn: a third of the
    points, and walls that stand upright all the same.
    """

    def __init__(self, scans, laser):
        self.scans = scans
        self.laser = laser
        parts = [surface(readings, laser) for _, readings in scans]
        turns = [pose.matrix() for pose, _ in scans]
        points = [p @ m[:3, :3].T + m[:3, 3] for (p, _), m in zip(parts, turns)]
        self.points = np.ascontiguousarray(np.vstack(points))
        self.normals = np.ascontiguousarray(np.vstack([n @ m[:3, :3].T for (_, n), m in zip(parts, turns)]))
        self.covariances = flat_covariances(self.normals)
        heights = np.resize(LAYERS, len(self.points))
        self.staggered = np.ascontiguousarray(self.points + np.outer(heights, (0, 0, 1)))
        self.layers = np.ascontiguousarray(np.vstack([self.points + (0, 0, z) for z in LAYERS]))


class Pair:
    """A scan, a reference, where matching starts and what it should find."""

    def __init__(self, index, task, lines):
        self.index, self.task = index, task
        self.guess = Pose(*numbers(lines["guess"][0]))
        self.truth = Pose(*numbers(lines["truth"][0]))
        bound = np.array(numbers(lines["bound"][0])).reshape(3, 3)
        self.bound = (bound[0, 0] + bound[1, 1], bound[2, 2])
        laser = numbers(lines["laser"][0])
        reference = [numbers(line) for line in lines["reference"]]
        self.reference = Cloud([(Pose(*n[:3]), np.array(n[3:])) for n in reference], laser)
        self.scan = Cloud([(Pose(0, 0, 0), np.array(numbers(lines["scan"][0])))], laser)

    def error(self, pose):
        """Distance (metres) and turn (radians) of a pose from the truth."""
        turn = math.remainder(pose.yaw - self.truth.yaw, math.tau)
        return math.hypot(pose.x - self.truth.x, pose.y - self.truth.y), abs(turn)


def read(path):
    pairs = []
    with open(path) as file:
        for line in file:
            word, _, rest = line.strip().partition(" ")
            if word == "pair":
                task, lines = rest, {}
            elif word == "end":
                pairs.append(Pair(len(pairs), task, lines))
            else:
                lines.setdefault(word, []).append(rest)
    return pairs


def numbers(line):
    return [float(word) for word in line.split()]


def surface(readings, laser):
    """Points of a scan's hits and the normals of lines through their neighbours."""
    _, start, step, low, high = laser
    bearings = start + step * np.arange(len(readings))
    hit = (readings >= low) & (readings < high)
    points = np.stack((readings * np.cos(bearings), readings * np.sin(bearings), 0 * bearings), 1)[hit]
    normals = np.array([normal(points, i) for i in range(len(points))])
    return points, normals


def normal(points, i):
    first = last = i
    while first > max(0, i - NEIGHBOURS) and near(points, first - 1):
        first -= 1
    while last < min(len(points) - 1, i + NEIGHBOURS) and near(points, last):
        last += 1
    xx, xy, _, yy = np.cov(points[first : last + 1, :2].T).ravel() if last > first else (1, 0, 0, 0)
    along = 0.5 * math.atan2(2 * xy, xx - yy)
    n = np.array((-math.sin(along), math.cos(along), 0.0))
    return n if n @ points[i] < 0 else -n


def flat_covariances(normals):
    """Small along the normal, one in the other directions: a wall."""
    outer = normals[:, :, None] * normals[:, None, :]
    return np.ascontiguousarray(np.eye(3) - (1 - FLAT) * outer)


def near(points, i):
    return math.dist(points[i], points[i + 1]) < JUMP
