use crate::args::{ConfigArgs, Switch};
use anyhow::{Context, Result, bail};
use matching::MatcherKind;
use rendering::{CastSettings, OccupancyRule};
use sensing::{DeskewSettings, LaserLimits};
use serde::{Deserialize, Serialize};
use slam::SlamConfig;
use toml::{Table, Value};

/// Everything that can be set. One configuration is meant for every building and every laser.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The map's looks.
    pub map: MapConfig,
    /// Which readings count.
    pub laser: LaserLimits,
    /// What is done to scans before they are used.
    pub scan: ScanConfig,
    /// Localisation, loop closing and refit.
    pub slam: SlamConfig,
}

/// What is done to scans before they are used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScanConfig {
    /// Every so-manieth beam is used, the others are left out.
    pub every_nth_beam: usize,
    /// Correction for the robot's motion while a scan was taken.
    pub deskew: DeskewSettings,
}

impl Default for ScanConfig {
    fn default() -> Self {
        ScanConfig { every_nth_beam: 1, deskew: DeskewSettings::default() }
    }
}

/// How the map is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MapConfig {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Empty border around what was seen, metres.
    pub margin_m: f64,
    /// How far beams are believed.
    pub cast: CastSettings,
    /// When a cell is wall.
    pub rule: OccupancyRule,
}

impl Default for MapConfig {
    fn default() -> Self {
        MapConfig {
            resolution_m: 0.05,
            margin_m: 1.0,
            cast: CastSettings::default(),
            rule: OccupancyRule::default(),
        }
    }
}

impl Config {
    /// The configuration that the command line asks for.
    pub fn load(args: &ConfigArgs) -> Result<Self> {
        let mut config = match &args.config {
            Some(path) => {
                let text = std::fs::read_to_string(path)
                    .with_context(|| format!("{}: cannot read", path.display()))?;
                Self::parse(&text, &path.display().to_string())?
            }
            None => Config::default(),
        };
        if let Some(switch) = args.odometry {
            config.slam.odometry.enabled = switch == Switch::On;
        }
        if let Some(kind) = args.matcher.as_deref().and_then(MatcherKind::named) {
            config.slam.front_end = kind;
        }
        if let Some(resolution_m) = args.resolution {
            config.map.resolution_m = resolution_m;
        }
        match config.problems().first() {
            Some(problem) => bail!("{problem}"),
            None => Ok(config),
        }
    }

    /// Reads TOML; everything that is wrong with it is told at once.
    pub fn parse(text: &str, name: &str) -> Result<Self> {
        let given: Table = text.parse().with_context(|| format!("{name}: not TOML"))?;
        let mut problems = Vec::new();
        compare(&mut String::new(), &given, &Self::default().to_table(), &mut problems);
        let config = if problems.is_empty() {
            match given.try_into::<Config>() {
                Ok(config) => config,
                Err(error) => bail!("{name}: {error}"),
            }
        } else {
            Config::default()
        };
        problems.extend(config.problems());
        match &problems[..] {
            [] => Ok(config),
            [problem] => bail!("{name}: {problem}"),
            _ => bail!("{name}: {} problems\n  {}", problems.len(), problems.join("\n  ")),
        }
    }

    /// Values that no run could end well with.
    fn problems(&self) -> Vec<String> {
        let mut problems: Vec<String> =
            self.laser.problems().into_iter().map(|p| format!("laser: {p}")).collect();
        let mut within = |name: &str, value: f64, least: f64, most: f64| {
            if !(least..=most).contains(&value) {
                problems.push(format!("{name} is {value}, must be from {least} to {most}"));
            }
        };
        within("map.resolution_m", self.map.resolution_m, 0.001, 10.0);
        within("map.margin_m", self.map.margin_m, 0.0, 1000.0);
        within("scan.deskew.sweep_secs", self.scan.deskew.sweep_secs, 0.0, 10.0);
        within("scan.deskew.reference", self.scan.deskew.reference, 0.0, 1.0);
        within("scan.every_nth_beam", self.scan.every_nth_beam as f64, 1.0, 1000.0);
        within("slam.field.cell_m", f64::from(self.slam.field.cell_m), 0.005, 5.0);
        problems
    }

    /// The configuration as TOML text.
    pub fn to_toml(self) -> String {
        // As in `to_table`: plain values cannot fail.
        toml::to_string(&self).unwrap_or_default()
    }

    fn to_table(self) -> Table {
        // Serialising plain numbers and switches cannot fail; an empty table would show in the
        // tests.
        let mut table = Table::try_from(self).unwrap_or_default();
        table.iter_mut().for_each(|(_, value)| shorten(value));
        table
    }
}

/// Undoes the widening of `f32`: 0.05 shall not print as 0.05000000074505806.
fn shorten(value: &mut Value) {
    match value {
        Value::Float(wide) => {
            let narrow = *wide as f32;
            if f64::from(narrow) == *wide {
                *wide = narrow.to_string().parse().unwrap_or(*wide);
            }
        }
        Value::Table(table) => table.iter_mut().for_each(|(_, value)| shorten(value)),
        Value::Array(values) => values.iter_mut().for_each(shorten),
        _ => {}
    }
}

/// Lists unknown keys, wrong types and impossible numbers. Every default is an example of its type,
/// and numbers here are magnitudes: finite and not negative where the default is not.
fn compare(path: &mut String, given: &Table, known: &Table, problems: &mut Vec<String>) {
    for (key, value) in given {
        let length = path.len();
        if !path.is_empty() {
            path.push('.');
        }
        path.push_str(key);
        match (known.get(key), value) {
            (None, _) => problems.push(format!("unknown key {path}{}", suggestion(key, known))),
            (Some(Value::Table(known)), Value::Table(given)) => {
                compare(path, given, known, problems)
            }
            (Some(Value::Float(default)), Value::Float(_) | Value::Integer(_)) => {
                let number = value.as_float().or(value.as_integer().map(|i| i as f64));
                let number = number.unwrap_or(f64::NAN);
                if !number.is_finite() {
                    problems.push(format!("{path} is {value}, must be finite"));
                } else if number < 0.0 && *default >= 0.0 {
                    problems.push(format!("{path} is {value}, must not be negative"));
                }
            }
            (Some(Value::Integer(_)), Value::Integer(number)) if *number < 0 => {
                problems.push(format!("{path} is {number}, must not be negative"));
            }
            (Some(default), _) if default.type_str() != value.type_str() => {
                let (is, should) = (value.type_str(), default.type_str());
                problems
                    .push(format!("{path} is of type {is}, must be {should}, such as {default}"));
            }
            _ => {}
        }
        path.truncate(length);
    }
}

/// The known key that is spelt most alike.
fn suggestion(key: &str, known: &Table) -> String {
    let alike = |other: &str| {
        let common = key.chars().zip(other.chars()).take_while(|(a, b)| a == b).count();
        let tail = key.chars().rev().zip(other.chars().rev()).take_while(|(a, b)| a == b).count();
        common + tail
    };
    match known.keys().max_by_key(|other| alike(other)).filter(|other| alike(other) >= 3) {
        Some(other) => format!("; did you mean {other}?"),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_can_be_read_back() {
        let mut config = Config::default();
        config.map.resolution_m = 0.01;
        config.slam.odometry.enabled = false;
        let text = config.to_toml();
        assert_eq!(Config::parse(&text, "shown").unwrap(), config);
        assert!(text.contains("resolution_m = 0.01\n"), "{text}");
        assert!(!text.contains("00000"), "widened numbers: {text}");
        assert_eq!(Config::parse("", "empty").unwrap(), Config::default());
        let partial = Config::parse("map.resolution_m = 1\n", "partial").unwrap();
        assert_eq!(partial.map.resolution_m, 1.0);
    }

    #[test]
    fn all_problems_are_told_at_once() {
        let text = "colour = 1\n[map]\nresolution = 0.1\nmargin_m = -1\n[laser]\nrange_max_m = inf\n\
            detect_no_return = 3\n[slam.odometry]\nenabled = \"yes\"\n";
        let error = Config::parse(text, "my.toml").unwrap_err().to_string();
        for part in [
            "my.toml: 6 problems",
            "unknown key colour",
            "unknown key map.resolution; did you mean resolution_m?",
            "map.margin_m is -1, must not be negative",
            "laser.range_max_m is inf, must be finite",
            "laser.detect_no_return is of type integer, must be boolean",
            "slam.odometry.enabled is of type string",
        ] {
            assert!(error.contains(part), "{part:?} missing in {error}");
        }
    }

    #[test]
    fn limits_must_fit_together() {
        let error =
            Config::parse("[laser]\nrange_min_m = 50\n", "my.toml").unwrap_err().to_string();
        assert!(error.contains("above range_min_m"), "{error}");
        let error = Config::parse("map.resolution_m = 0\nslam.field.cell_m = 1e-7\n", "my.toml");
        assert!(error.unwrap_err().to_string().contains("2 problems"));
        assert!(Config::parse("= 3", "my.toml").unwrap_err().to_string().contains("my.toml"));
    }
}
