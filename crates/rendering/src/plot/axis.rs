/// One axis of a [`super::Panel`].
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// How values lie along it.
    pub kind: AxisKind,
}

/// How values lie along an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisKind {
    /// Evenly from one value to the other.
    Linear(f64, f64),
    /// By their logarithm, between two values above zero; what lies outside is drawn at the border.
    Log(f64, f64),
    /// Whole numbers from 0, each with a name.
    Names(Vec<String>),
}

/// A mark on an axis.
pub(super) struct Tick {
    /// Where, as a share of the axis.
    pub at: f64,
    /// Empty for a mark between two labelled ones.
    pub label: String,
}

impl Axis {
    /// An axis with a label.
    pub fn new(label: &str, kind: AxisKind) -> Self {
        Axis { label: label.to_owned(), kind }
    }

    /// The powers of ten around all values above zero; one decade at least.
    pub fn log_around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let logs = values.into_iter().filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
        let (low, high) =
            logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let (low, high) = if low <= high { (low.floor(), high.ceil()) } else { (0.0, 1.0) };
        let kind = AxisKind::Log(10_f64.powf(low), 10_f64.powf(high.max(low + 1.0)));
        Axis::new(label, kind)
    }

    /// Where a value lies, as a share of the axis.
    pub(super) fn place(&self, value: f64) -> f64 {
        match &self.kind {
            AxisKind::Linear(from, to) => (value - from) / (to - from),
            AxisKind::Log(from, to) => {
                let value = value.clamp(*from, *to);
                (value / from).ln() / (to / from).ln()
            }
            AxisKind::Names(names) => (value + 0.5) / names.len().max(1) as f64,
        }
    }

    /// The marks, about `room` of them at most with a label.
    pub(super) fn ticks(&self, room: f64) -> Vec<Tick> {
        match &self.kind {
            AxisKind::Linear(from, to) => linear_ticks(*from, *to, room),
            AxisKind::Log(from, to) => self.log_ticks(*from, *to),
            AxisKind::Names(names) => (0..)
                .zip(names)
                .map(|(k, name)| Tick { at: self.place(f64::from(k)), label: name.clone() })
                .collect(),
        }
    }

    fn log_ticks(&self, from: f64, to: f64) -> Vec<Tick> {
        let (low, high) = (from.log10().floor() as i32, to.log10().ceil() as i32);
        let mut ticks = Vec::new();
        for exponent in low..=high {
            for factor in 1..10 {
                let value = f64::from(factor) * 10_f64.powi(exponent);
                if value < from * 0.999 || value > to * 1.001 {
                    continue;
                }
                let label = if factor == 1 { plain(value, -exponent) } else { String::new() };
                ticks.push(Tick { at: self.place(value), label });
            }
        }
        ticks
    }
}

fn linear_ticks(from: f64, to: f64, room: f64) -> Vec<Tick> {
    let least = (to - from).abs() / room.max(1.0);
    if !(least > 0.0 && least.is_finite()) {
        return Vec::new();
    }
    let power = 10_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|f| f * power).into_iter().find(|s| *s >= least * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let decimals = -(step.log10().floor() as i32);
    let (low, high) = (from.min(to), from.max(to));
    let first = (low / step).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|k| {
            let value = k as f64 * step;
            Tick { at: (value - from) / (to - from), label: plain(value, decimals) }
        })
        .collect()
}

/// A number with as many decimals as it needs.
fn plain(value: f64, decimals: i32) -> String {
    format!("{value:.*}", decimals.max(0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, room: f64) -> Vec<String> {
        axis.ticks(room).into_iter().map(|t| t.label).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        let linear = Axis::new("", AxisKind::Linear(-1.0, 1.0));
        assert_eq!(labels(&linear, 5.0), ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        let log = Axis::log_around("", [0.002, 0.0, 3.0, f64::NAN]);
        assert_eq!(log.kind, AxisKind::Log(0.001, 10.0));
        assert_eq!(labels(&log, 9.0), ["0.001", "0.01", "0.1", "1", "10"]);
        assert_eq!(labels(&Axis::log_around("", []), 9.0), ["1", "10"]);
    }

    #[test]
    fn values_outside_a_log_axis_lie_at_its_border() {
        let log = Axis::new("", AxisKind::Log(0.1, 10.0));
        assert_eq!([0.0, 0.1, 1.0, 99.0].map(|v| log.place(v)), [0.0, 0.0, 0.5, 1.0]);
    }
}
