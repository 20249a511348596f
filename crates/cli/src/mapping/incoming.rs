use crate::config::{Config, ScanConfig};
use geometry::Pose2;
use logs::{LogRecord, ReadOptions};
use sensing::Stamp;
use sensing::{Observation, Velocimeter};
use slam::{Preparation, PreparedObservation};
use std::sync::Arc;
use store::TakenScan;

/// A scan on its way from the reader to the mapper.
pub struct IncomingScan {
    /// The stamp.
    pub stamp: Stamp,
    /// The stamp as the log has it.
    pub stamp_text: String,
    /// Robot base in its odometry frame.
    pub odom_from_base: Option<Pose2>,
    /// The scan as the manifold file keeps it; where it was found is not known yet.
    pub taken: TakenScan,
    /// What the mapper takes.
    pub input: MapperInput,
}

/// Preparing is the same work on either thread; it is done where there is time.
pub enum MapperInput {
    /// As read: the reader was behind.
    Read(Box<Observation>),
    /// Prepared for the mapper.
    Prepared(Box<PreparedObservation>),
}

/// What the reading thread does with every scan.
pub fn preparing(config: &Config) -> impl FnMut(LogRecord, bool) -> IncomingScan + Send + use<> {
    let mut preparation = Preparation::new(&config.slam);
    let mut velocimeter = Velocimeter::default();
    let ScanConfig { every_nth_beam, deskew } = config.scan;
    move |record, behind| {
        let LogRecord { mut observation, stamp_text, twist, .. } = record;
        let Observation { stamp, odom_from_base, .. } = observation;
        let measured = velocimeter.observe(stamp, odom_from_base);
        if every_nth_beam > 1 {
            observation.scan = observation.scan.every(every_nth_beam);
        }
        observation.sweep = deskew.sweep(twist.or(measured));
        let taken = TakenScan {
            found: Pose2::IDENTITY,
            base_from_laser: observation.base_from_laser,
            sweep: observation.sweep,
            attitude: observation.attitude,
            scan: Some(Arc::new(observation.scan.clone())),
        };
        let input = match behind {
            true => MapperInput::Read(Box::new(observation)),
            false => MapperInput::Prepared(Box::new(preparation.prepare(observation))),
        };
        IncomingScan { stamp, stamp_text, odom_from_base, taken, input }
    }
}

/// How logs are read under a configuration.
pub fn read_options(config: &Config) -> ReadOptions {
    ReadOptions {
        limits: config.laser,
        use_odometry: config.slam.odometry.enabled,
        ..ReadOptions::default()
    }
}
