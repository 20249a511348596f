// Printed figures that happen to be near pi / 4 stay as printed.
#![allow(clippy::approx_constant)]

/// A row of table 7.1: errors in metres in the order of [`matching::protocol::CELL_NAMES`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThesisRow {
    /// The algorithm, as the thesis writes it.
    pub name: &'static str,
    /// The nine cells.
    pub cells: [f64; 9],
    /// The "mean", in fact the root mean square over all disturbances.
    pub overall: f64,
    /// Mean number of iterations.
    pub iterations: f64,
}

const fn row(name: &'static str, cells: [f64; 9], overall: f64, iterations: f64) -> ThesisRow {
    ThesisRow { name, cells, overall, iterations }
}

/// What a matcher that returns its guess would score, in every situation.
pub const BASE: ThesisRow = row(
    "base",
    [0.0, 0.25, 0.5, 0.785398, 0.824227, 0.931048, 1.570796, 1.590566, 1.648454],
    1.175057,
    f64::NAN,
);

/// The results of the ManifoldSLAM thesis (2006), section 7.1.3, situations 1 to 4: NDT, IDC,
/// MbICP, WSM. Its scans are not published.
#[rustfmt::skip]
pub const ROWS: [[ThesisRow; 4]; 4] = [
    [
        row("NDT", [0.001094, 0.325732, 0.522488, 0.785398, 1.019792, 0.905721, 1.570796, 1.592676, 1.682743],
            1.211989, 2.117647),
        row("IDC", [0.006687, 0.007594, 0.007845, 0.007873, 0.007873, 0.007873, 4.185263, 3.931223, 3.831785],
            2.466790, 24.717647),
        row("MbICP", [0.010804, 0.010489, 0.011106, 0.011206, 0.010933, 0.010854, 0.011329, 0.010947, 1.216617],
            0.527934, 20.435294),
        row("WSM", [0.009132, 0.009132, 0.009132, 0.009132, 0.009132, 0.009132, 1.227053, 2.013077, 1.046770],
            1.002273, 16.223529),
    ],
    [
        row("NDT", [0.000000, 0.253762, 0.519781, 0.785398, 0.843109, 0.980248, 1.356286, 1.673229, 1.677732],
            1.208638, 1.894118),
        row("IDC", [0.041257, 0.063864, 0.310380, 0.069467, 0.320919, 0.389518, 1.607720, 1.586968, 1.576797],
            1.029767, 20.705882),
        row("MbICP", [0.006066, 0.119723, 0.129221, 0.037217, 0.120134, 0.135755, 0.076706, 0.661858, 0.672813],
            0.420649, 30.352941),
        row("WSM", [0.011013, 0.011527, 0.152342, 0.011694, 0.052939, 0.169485, 0.012337, 0.094252, 1.103251],
            0.488799, 17.482353),
    ],
    [
        row("NDT", [0.000000, 1.078081, 0.489488, 0.786170, 0.831364, 0.925397, 1.570796, 1.590607, 1.709810],
            1.233846, 2.176471),
        row("IDC", [0.012821, 0.012821, 0.012821, 0.936856, 1.043303, 0.967307, 3.472407, 2.858219, 2.845654],
            1.935837, 21.882353),
        row("MbICP", [0.003299, 0.006904, 0.007047, 0.006979, 0.006708, 0.073947, 0.006394, 1.545696, 1.531521],
            0.944613, 16.741176),
        row("WSM", [0.001959, 0.001959, 0.001934, 0.001926, 4.378479, 4.377351, 1.198689, 3.403532, 7.742021],
            4.551092, 17.329412),
    ],
    [
        row("NDT", [0.000121, 0.191923, 0.719698, 0.785398, 0.794804, 1.004130, 1.575583, 1.601607, 1.617779],
            1.187160, 2.294118),
        row("IDC", [0.0; 9],
            0.0, 51.941176),
        row("MbICP", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.470635, 0.472485],
            0.289337, 29.988235),
        row("WSM", [0.0; 9],
            0.0, 24.494118),
    ],
];

#[cfg(test)]
mod tests {
    use super::*;
    use matching::protocol::overall_rms;

    /// No digit was lost on the way, and the "mean" is a root mean square.
    #[test]
    fn the_means_are_root_mean_squares_of_the_cells() {
        for row in ROWS.iter().flatten().chain([&BASE]) {
            let overall = overall_rms(&row.cells);
            assert!((overall - row.overall).abs() < 1e-6, "{}: {overall}", row.name);
        }
    }
}
