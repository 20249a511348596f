use super::contender::{Contender, Pair, cloud};
use super::situations::Place;
use crate::config::Config;
use anyhow::{Context, Result, bail};
use geometry::Pose2;
use logs::{CarmenReader, LogFile, ReadOptions};
use sensing::Observation;
use std::path::{Path, PathBuf};
use synthetic::FloorPlan;

/// A scan of a log: its file and its number, the first being 1.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Named {
    log: PathBuf,
    number: usize,
}

impl Named {
    /// Understands `LOG`, `LOG:N` and `LOG#N`; a file of the whole name comes first.
    fn parse(text: &str) -> Result<Self> {
        let whole = Named { log: PathBuf::from(text), number: 1 };
        if whole.log.exists() {
            return Ok(whole);
        }
        let Some((log, number)) = text.rsplit_once(['#', ':']) else { return Ok(whole) };
        match number.parse() {
            Ok(number) if number > 0 => Ok(Named { log: PathBuf::from(log), number }),
            Ok(_) => bail!("{text}: scans are counted from 1"),
            Err(_) => Ok(whole),
        }
    }

    fn read(&self) -> Result<Observation> {
        let mut reader =
            CarmenReader::new(LogFile::open(&self.log)?.input, options()).with_name(&self.log);
        let found = reader.by_ref().nth(self.number - 1);
        let count = reader.finish().scans;
        let name = self.log.display();
        let record =
            found.with_context(|| format!("{name}: has {count} scans, no {}th", self.number))?;
        if record.observation.scan.hit_count() < 3 {
            bail!("{name}, scan {}: fewer than three beams saw anything", self.number);
        }
        Ok(record.observation)
    }
}

/// As mapping reads logs.
pub fn options() -> ReadOptions {
    crate::mapping::read_options(&Config::default())
}

/// Two scans of the user's own as a place.
///
/// The guess they are first matched from is their odometry where both are of one log, else that
/// they were taken at the same pose.
pub fn place(names: &[String], truth: Option<Pose2>, contenders: &[Contender]) -> Result<Place> {
    let [first, second] = names else { bail!("--scans needs two scans") };
    let (first, second) = (Named::parse(first)?, Named::parse(second)?);
    let (reference, scan) = (first.read()?, second.read()?);
    let odometry = match (reference.odom_from_base, scan.odom_from_base) {
        (Some(a), Some(b)) if first.log == second.log => a.between(&b),
        _ => Pose2::IDENTITY,
    };
    let [reference, scan] = [reference, scan].map(|seen| cloud(&seen.scan, &seen.base_from_laser));
    let mut pair = Pair { reference, scan, truth: odometry };
    pair.truth = match truth {
        Some(truth) => truth,
        None => agreed(&pair, contenders)?,
    };
    let stem = |log: &Path| crate::mapping::stem(log);
    let name =
        format!("{}:{} - {}:{}", stem(&first.log), first.number, stem(&second.log), second.number);
    Ok(Place {
        name,
        thesis: None,
        pairs: vec![pair],
        bound: None,
        plan: FloorPlan::new(),
        world_from_reference: Pose2::IDENTITY,
    })
}

/// What the first matcher finds.
fn agreed(pair: &Pair, contenders: &[Contender]) -> Result<Pose2> {
    let first = contenders.first().context("no matcher was named")?;
    let (found, _) = first.timed(pair, &pair.truth);
    if !found.status.is_usable() {
        bail!(
            "{} does not find the scans' relative pose; name another matcher first or give --truth",
            first.name
        );
    }
    Ok(found.pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_are_named_by_log_and_number() {
        let named = |text: &str| Named::parse(text).ok().map(|n| (n.log, n.number));
        assert_eq!(named("a.clf"), Some(("a.clf".into(), 1)));
        assert_eq!(named("a.clf:7"), Some(("a.clf".into(), 7)));
        assert_eq!(named("b:c.clf#3"), Some(("b:c.clf".into(), 3)));
        assert_eq!(named("b:c.clf"), Some(("b:c.clf".into(), 1)));
        assert_eq!(named("a.clf:0"), None);
    }
}
