use crate::CloudPoint;
use geometry::{Matrix2, Vector2};

/// The points of a cell as a normal distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distribution {
    pub mean: Vector2<f64>,
    pub covariance: Matrix2<f64>,
    /// Inverse of the covariance.
    pub information: Matrix2<f64>,
    /// What of a displacement the cell's surface tells: that across it, less what the error of its
    /// direction pretends.
    pub observed: Matrix2<f64>,
    /// Number of points.
    pub count: f64,
}

/// How points become distributions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Side of a cell, metres.
    pub side_m: f64,
    /// A cell's smaller variance is at least this share of its larger one.
    pub flatness: f64,
    /// Fewer points than this make no cell.
    pub min_points: usize,
    /// Whether a wall goes on beyond its cell, and a place along it means nothing.
    pub endless: bool,
    /// How often cells are doubled for points that are too few for one.
    pub doublings: u32,
}

/// Share of the normals' square along the wall below which a cell is one wall: 13 degrees.
const ONE_WALL: f64 = 0.05;
/// The same for the points' variances, where normals are not known.
const ONE_LINE: f64 = 0.05;
/// Standard deviation along an endless wall in sides of a cell.
const ENDLESS: f64 = 100.0;

/// Factor on the variances of a cell that is no single wall: where its mean lies depends on which
/// part of a corner or of a trunk was seen.
const BLOB: f64 = 4.0;
/// The usual variance across walls counts as that of so many points.
const COMMON_POINTS: f64 = 10.0;

/// The moments of some points.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    pub count: f64,
    position: Vector2<f64>,
    square: Matrix2<f64>,
    /// Number of points with normals, the normals' squares and variances.
    normals: (f64, Matrix2<f64>, f64),
}

/// What the points of a cell alone say of its distribution.
pub(super) struct Spread {
    mean: Vector2<f64>,
    /// Across a wall and along it, if it is one; the principal axes otherwise.
    axes: Matrix2<f64>,
    variances: Vector2<f64>,
    least: f64,
    is_wall: bool,
    observed: Matrix2<f64>,
    count: f64,
}

impl Spread {
    /// Variance across the wall, of a cell that is one.
    pub fn across(&self) -> Option<f64> {
        self.is_wall.then_some(self.variances.x)
    }

    /// The distribution; `common` is the usual variance across the walls of its cloud. Few points
    /// hardly know their own, and those that seem thin by chance must not pull more than others.
    pub fn distribution(mut self, shape: &Shape, common: f64) -> Distribution {
        if let Some(across) = self.across() {
            let pooled = across * self.count + common * COMMON_POINTS;
            self.variances.x = pooled / (self.count + COMMON_POINTS);
        }
        if self.is_wall && shape.endless {
            self.variances.y = (ENDLESS * shape.side_m).powi(2);
        }
        let variances = self.variances.map(|v| v.max(self.least));
        let rebuilt =
            |d: Vector2<f64>| self.axes * Matrix2::from_diagonal(&d) * self.axes.transpose();
        Distribution {
            mean: self.mean,
            covariance: rebuilt(variances),
            information: rebuilt(variances.map(f64::recip)),
            observed: self.observed,
            count: self.count,
        }
    }
}

/// A cell's wall: its normal and the variance of that.
struct Wall {
    normal: Vector2<f64>,
    variance: f64,
}

impl Sums {
    pub fn add_point(&mut self, point: &CloudPoint) {
        self.count += 1.0;
        self.position += point.position;
        self.square += point.position * point.position.transpose();
        if let Some(normal) = point.normal {
            self.normals.0 += 1.0;
            self.normals.1 += normal * normal.transpose();
            self.normals.2 += point.normal_variance.max(0.0);
        }
    }

    pub fn add(&mut self, other: &Sums) {
        self.count += other.count;
        self.position += other.position;
        self.square += other.square;
        self.normals.0 += other.normals.0;
        self.normals.1 += other.normals.1;
        self.normals.2 += other.normals.2;
    }

    /// `None` for few points, and for points that are all in one place.
    pub fn spread(&self, shape: &Shape) -> Option<Spread> {
        if self.count < shape.min_points.max(3) as f64 {
            return None;
        }
        let mean = self.position / self.count;
        let scatter = self.square / self.count - mean * mean.transpose();
        let covariance = scatter * (self.count / (self.count - 1.0));
        let covariance = 0.5 * (covariance + covariance.transpose());
        let eigen = covariance.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        if largest.is_nan() || largest < 1e-8 {
            return None;
        }
        let minor = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let wall = self.wall(minor, eigen.eigenvalues.min() / largest);
        let (axes, variances) = match &wall {
            Some(Wall { normal, .. }) => {
                let axes = Matrix2::from_columns(&[*normal, turned(normal)]);
                (axes, (axes.transpose() * covariance * axes).diagonal())
            }
            None => (eigen.eigenvectors, eigen.eigenvalues * BLOB),
        };
        let least = (shape.flatness * largest).max(1e-6);
        let observed = self.observed(wall.as_ref());
        let is_wall = wall.is_some();
        Some(Spread { mean, axes, variances, least, is_wall, observed, count: self.count })
    }

    /// Whether most points know their normals.
    fn knows_normals(&self) -> bool {
        2.0 * self.normals.0 >= self.count
    }

    /// The cell's wall if it is a single one; `minor` is the direction that the points spread
    /// least in, `ratio` that of the variances.
    fn wall(&self, minor: Vector2<f64>, ratio: f64) -> Option<Wall> {
        let thin = ratio < ONE_LINE;
        if !self.knows_normals() {
            let variance = ratio / self.count;
            return thin.then_some(Wall { normal: minor, variance });
        }
        let (count, squares, variances) = self.normals;
        let eigen = (squares / count).symmetric_eigen();
        let variance = variances / count;
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
        // The points' own line is the better one where they are a line.
        let agrees = thin && minor.dot(&normal).abs() > 0.9;
        let wall = Wall { normal: if agrees { minor } else { normal }, variance };
        (eigen.eigenvalues.min() < ONE_WALL + variance).then_some(wall)
    }

    /// By the points' normals where they are known: lines fitted to more than one small cell.
    fn observed(&self, wall: Option<&Wall>) -> Matrix2<f64> {
        if self.knows_normals() {
            let (count, squares, variances) = self.normals;
            return squares / count - Matrix2::identity() * (variances / count);
        }
        let Some(Wall { normal, variance }) = wall else { return Matrix2::identity() * 0.5 };
        let along = turned(normal);
        normal * normal.transpose() - along * along.transpose() * *variance
    }
}

fn turned(v: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-v.y, v.x)
}
