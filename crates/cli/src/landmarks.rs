//! The landmarks of a result: a table, and marks on the maps.

use crate::mapping::MappedTeam;
use crate::metrics::name_in_files;
use crate::result::csv_field;
use rendering::{ClosureMark, MarkKind};
use slam::IslandLandmark;
use std::fmt::Write;

/// A landmark on the map, with the index of its island.
pub struct MappedLandmark {
    /// From 0.
    pub island: usize,
    /// What is known of it.
    pub landmark: IslandLandmark,
}

/// The landmarks by island, kind and id.
pub fn landmarks_of(mapped: &MappedTeam) -> Vec<MappedLandmark> {
    let placed = |landmark: IslandLandmark| {
        Some(MappedLandmark { island: mapped.islands.index(landmark.patch)?, landmark })
    };
    let mut all: Vec<_> = mapped.team.landmarks().into_iter().filter_map(placed).collect();
    // Stable: several places of one id stay in their order, the one seen most often first.
    let key = |m: &MappedLandmark| (m.island, m.landmark.kind, m.landmark.id.clone());
    all.sort_by_key(key);
    all
}

/// `landmarks.csv`: what was seen where, how well that is known, how often and by whom it was seen.
pub fn landmarks_csv(mapped: &MappedTeam, landmarks: &[MappedLandmark]) -> String {
    let mut text = String::from("id,kind,island,x_m,y_m,std_m,sightings,robots\n");
    for MappedLandmark { island, landmark } in landmarks {
        let at = landmark.in_island();
        // The longer axis of the ellipse.
        let variance = landmark.covariance.symmetric_eigenvalues().max();
        let names = landmark.robots.iter().map(|r| mapped.robots[usize::from(r.0)].name.as_str());
        let _ = writeln!(
            text,
            "{},{},{},{:.3},{:.3},{:.3},{},{}",
            csv_field(landmark.id.as_deref().unwrap_or_default()),
            name_in_files(&landmark.kind),
            island + 1,
            at.x,
            at.y,
            variance.max(0.0).sqrt(),
            landmark.sightings,
            csv_field(&names.collect::<Vec<_>>().join(";")),
        );
    }
    text
}

/// The landmarks of one island, to be drawn where they are.
pub fn landmark_marks(landmarks: &[MappedLandmark], island: usize) -> Vec<ClosureMark> {
    let here = landmarks.iter().filter(|m| m.island == island);
    here.map(|m| m.landmark.in_island())
        .map(|at| ClosureMark { from: at, to: at, kind: MarkKind::Sighted })
        .collect()
}
