"""One class for each way that a peer from PyPI matches.

`prepare(reference)` and `load(scan)` build what the peer can build before a match; `align` is the
match. Both take a `pairs.Cloud`: its layers and normals are made by us and charged to nobody.
`stages` are the correspondence gates that a match goes through, wide to narrow. Settings were tried
on other rooms than those that are scored (see README.md).
"""

import importlib

from pairs import Pose


class SmallGicp:
    """small_gicp; all but plain ICP on clouds with a third dimension, layered or staggered."""

    package = "small_gicp"

    def __init__(self, lib, kind, stages, form="layers", neighbours=40, voxel=None):
        self.lib, self.kind, self.stages, self.form = lib, kind, stages, form
        self.neighbours, self.voxel = neighbours, voxel
        self.name = f"small_gicp {kind}" + (f", {form}" if form != "points" else "")

    def cloud(self, cloud):
        points = self.lib.PointCloud(getattr(cloud, self.form))
        tree = self.lib.KdTree(points)
        if self.kind == "PLANE_ICP":
            self.lib.estimate_normals(points, tree, self.neighbours)
        elif self.kind != "ICP":
            self.lib.estimate_covariances(points, tree, self.neighbours)
        return points, tree

    def prepare(self, reference):
        points, tree = self.cloud(reference)
        if self.kind != "VGICP":
            return points, tree
        voxels = self.lib.GaussianVoxelMap(self.voxel)
        voxels.insert(points)
        return voxels, None

    def load(self, scan):
        if self.kind in ("ICP", "PLANE_ICP"):
            return self.lib.PointCloud(getattr(scan, self.form))
        return self.cloud(scan)[0]

    def align(self, prepared, scan, guess):
        target, tree = prepared
        pose = guess.matrix()
        settings = dict(rotation_epsilon=1e-4, translation_epsilon=2e-4)
        for gate, iterations in self.stages:
            gated = dict(settings, max_correspondence_distance=gate, max_iterations=iterations)
            if self.kind == "VGICP":
                found = self.lib.align(target, scan, pose, **gated)
            else:
                found = self.lib.align(target, scan, tree, pose, registration_type=self.kind, **gated)
            pose = found.T_target_source
        return Pose.of_matrix(pose)


class KissIcp:
    """The registration of KISS-ICP against a voxel map of the reference; no motion model."""

    package = "kiss_icp"

    def __init__(self, _, voxel, most, stages):
        self.bind = importlib.import_module("kiss_icp.pybind.kiss_icp_pybind")
        self.voxel, self.most, self.stages = voxel, most, stages
        self.name = f"kiss-icp, voxel {voxel} m"
        self.registration = self.bind._Registration(500, 1e-4, 1)

    def prepare(self, reference):
        voxels = self.bind._VoxelHashMap(self.voxel, 100.0, self.most)
        voxels._add_points(self.bind._Vector3dVector(reference.points))
        return voxels

    def load(self, scan):
        return self.bind._Vector3dVector(scan.points)

    def align(self, voxels, scan, guess):
        pose = guess.matrix()
        for gate, kernel in self.stages:
            pose = self.registration._align_points_to_map(scan, voxels, pose, gate, kernel)
        return Pose.of_matrix(pose)


class Open3d:
    """Open3D's registration pipeline; it builds its search tree anew in every call."""

    package = "open3d"

    def __init__(self, lib, kind, stages):
        self.lib, self.kind, self.stages = lib, kind, stages
        self.name = f"open3d {kind}"
        lib.utility.set_verbosity_level(lib.utility.VerbosityLevel.Error)

    def load(self, cloud):
        vectors = self.lib.utility.Vector3dVector
        points = self.lib.geometry.PointCloud(vectors(cloud.points))
        points.normals = vectors(cloud.normals)
        if self.kind == "generalized":
            # Otherwise it would make them from the normals in every call.
            points.covariances = self.lib.utility.Matrix3dVector(cloud.covariances)
        return points

    prepare = load

    def estimation(self, kernel):
        registration = self.lib.pipelines.registration
        if self.kind == "point-to-point":
            return registration.TransformationEstimationPointToPoint()
        loss = registration.GMLoss(kernel)
        if self.kind == "point-to-plane":
            return registration.TransformationEstimationPointToPlane(loss)
        return registration.TransformationEstimationForGeneralizedICP(1e-3, loss)

    def align(self, reference, scan, guess):
        registration = self.lib.pipelines.registration
        match = registration.registration_icp
        if self.kind == "generalized":
            match = registration.registration_generalized_icp
        pose = guess.matrix()
        for gate, kernel, iterations in self.stages:
            criteria = registration.ICPConvergenceCriteria(1e-6, 1e-6, iterations)
            pose = match(scan, reference, gate, pose, self.estimation(kernel), criteria).transformation
        return Pose.of_matrix(pose)


class Karto:
    """OpenKarto's correlative matcher; its grid is built in every call."""

    package = "karto_scanmatcher"

    def __init__(self, lib, search, resolution=0.01, smear=0.03):
        self.lib = lib
        self.name = f"karto-scanmatcher, {search} m"
        config = lib.ScanMatcherConfig()
        config.search_size = search
        config.resolution = resolution
        config.smear_deviation = smear
        self.matcher = lib.Wrapper(config)

    def scan(self, laser, readings, pose):
        _, start, step, low, high = laser
        last = start + step * (len(readings) - 1)
        config = self.lib.LaserScanConfig(start, last, step, low, high, high, "laser")
        at = self.lib.Pose2(*pose)
        return self.lib.LocalizedRangeScan(config, readings.tolist(), at, at, 0, 0.0)

    def prepare(self, reference):
        return [self.scan(reference.laser, readings, pose) for pose, readings in reference.scans]

    def load(self, scan):
        return scan

    def align(self, reference, scan, guess):
        # No penalty for leaving the guess: it is a starting point only.
        scan = self.scan(scan.laser, scan.scans[0][1], guess)
        best = self.matcher.match_scan(scan, reference, False, True).best_pose
        return Pose(best.x, best.y, best.yaw)


CONTESTANTS = [
    (SmallGicp, dict(kind="ICP", stages=[(1.0, 20), (0.3, 20), (0.1, 20)], form="points")),
    (SmallGicp, dict(kind="PLANE_ICP", stages=[(1.0, 10), (0.3, 10), (0.1, 10)])),
    (SmallGicp, dict(kind="GICP", stages=[(1.0, 6), (0.3, 6), (0.1, 6)])),
    (SmallGicp, dict(kind="VGICP", stages=[(1.0, 20)], voxel=0.5)),
    (SmallGicp, dict(kind="GICP", stages=[(1.0, 6), (0.3, 6), (0.1, 6)], form="staggered", neighbours=20)),
    (SmallGicp, dict(kind="VGICP", stages=[(1.0, 20)], form="staggered", neighbours=20, voxel=0.5)),
    (KissIcp, dict(voxel=0.5, most=100, stages=[(1.0, 0.3), (0.2, 0.03)])),
    (KissIcp, dict(voxel=1.0, most=100, stages=[(1.0, 0.1)])),
    (Open3d, dict(kind="point-to-point", stages=[(1.0, 0, 20), (0.3, 0, 20), (0.1, 0, 30)])),
    (Open3d, dict(kind="point-to-plane", stages=[(1.0, 0.3, 6), (0.3, 0.03, 10)])),
    (Open3d, dict(kind="generalized", stages=[(1.0, 6.0, 10), (0.3, 1.0, 10)])),
    (Karto, dict(search=0.3)),
    (Karto, dict(search=1.0)),
]
# What the table says of them.
NOTES = {
    "small_gicp": "a library for 3D sees no walls in points at one height: layers have each point at 0 and +-0.1 m, "
    "staggered points take these heights in turn (a third of the points, about as accurate); covariances from 40 and "
    "20 neighbours; gates 1, 0.3, 0.1 m one after another, VGICP 1 m with voxels of 0.5 m; steps down to 0.2 mm",
    "kiss_icp": "its registration against a voxel map of the reference, 100 points a voxel; gate and kernel "
    "(1, 0.3) then (0.2, 0.03) m, or (1, 0.1) m",
    "open3d": "2D normals and covariances supplied; gates 1, 0.3 (and 0.1) m one after another, Geman-McClure "
    "kernels; its search tree is built in every call and is part of the match",
    "karto_scanmatcher": "search in a square of 1 m or of 0.3 m (its default, enough for tracking only), +-20 degrees, resolution 10 mm, smear 30 mm, no penalties; its grid is "
    "built in every call and is part of the match",
}


def installed(report):
    """The contestants whose packages can be imported; `report` is told of the others."""
    missing = set()
    for kind, settings in CONTESTANTS:
        try:
            lib = importlib.import_module(kind.package)
        except ImportError as error:
            if kind.package not in missing:
                report(f"{kind.package}: left out, {error}")
            missing.add(kind.package)
            continue
        yield kind(lib, **settings)
