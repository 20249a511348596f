use super::{Fault, IntegritySettings};
use sensing::{BeamClass, Observation, Scan, Stamp};

/// What the sensors say of themselves, scan by scan.
#[derive(Clone, Debug)]
pub(crate) struct SensorWatch {
    settings: IntegritySettings,
    /// The fault that holds.
    fault: Option<Fault>,
    /// Another state that is about to hold.
    coming: Option<Coming>,
}

#[derive(Clone, Copy, Debug)]
struct Coming {
    fault: Option<Fault>,
    since: Stamp,
    scans: usize,
}

/// What a scan decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Nothing new: data are good, or bad as before.
    Unchanged,
    /// Data are bad, and have been for so many scans, this one included.
    WentBad(Fault, usize),
    /// Data are good again, beginning with this scan.
    GoodAgain,
}

/// Data are good again after so many scans: what lies between would only be a few scans more.
const GOOD_SCANS: usize = 3;

impl SensorWatch {
    pub fn new(settings: IntegritySettings) -> Self {
        SensorWatch { settings, fault: None, coming: None }
    }

    /// True while data are bad.
    pub fn is_bad(&self) -> bool {
        self.fault.is_some()
    }

    /// True while data may turn out to have gone bad.
    pub fn is_in_doubt(&self) -> bool {
        self.fault.is_some() || self.coming.is_some()
    }

    /// Takes the next observation.
    pub fn watch(&mut self, observation: &Observation) -> Verdict {
        let now = self.fault_of(observation);
        if !self.settings.enabled || now == self.fault {
            self.coming = None;
            return Verdict::Unchanged;
        }
        let fresh = Coming { fault: now, since: observation.stamp, scans: 0 };
        let coming = self.coming.get_or_insert(fresh);
        if coming.fault != now {
            *coming = fresh;
        }
        coming.scans += 1;
        let Coming { since, scans, .. } = *coming;
        if !self.is_decided(now, scans, observation.stamp.secs_since(since)) {
            return Verdict::Unchanged;
        }
        self.coming = None;
        self.fault = now;
        now.map_or(Verdict::GoodAgain, |fault| Verdict::WentBad(fault, scans))
    }

    fn is_decided(&self, fault: Option<Fault>, scans: usize, secs: f64) -> bool {
        match fault {
            None => scans >= GOOD_SCANS,
            Some(Fault::Blind) => scans >= self.settings.scans && secs >= self.settings.blind_secs,
            Some(_) => scans >= self.settings.scans,
        }
    }

    fn fault_of(&self, observation: &Observation) -> Option<Fault> {
        let leans = observation.attitude.is_some_and(|attitude| {
            // The angle between the base's up and the world's.
            let up = attitude.roll_rad.cos() * attitude.pitch_rad.cos();
            up < self.settings.tipped_rad.cos()
        });
        if leans {
            return Some(Fault::Tipped);
        }
        self.is_blind(&observation.scan).then_some(Fault::Blind)
    }

    /// A laser in the open sees nothing either, but says so: beams without return are of use.
    fn is_blind(&self, scan: &Scan) -> bool {
        let useful = |&beam: &usize| match scan.class(beam) {
            BeamClass::Hit => f64::from(scan.range(beam)) > self.settings.cover_m,
            BeamClass::NoReturn => true,
            BeamClass::TooClose | BeamClass::Invalid => false,
        };
        let most = self.settings.blind_share * scan.len() as f64;
        (0..scan.len()).filter(useful).count() as f64 <= most
    }
}
