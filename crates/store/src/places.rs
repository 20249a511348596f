//! Where patches lie, in an R*Tree: for those who look for the patches of a region with SQL.
//!
//! Derived from the patches, not checked on opening (the map is not read from it), compared with
//! them by `verify`.

use crate::error::Finding;
use manifold::{Patch, PatchId};
use rusqlite::{Connection, params_from_iter};

const NAME: &str = "patch_places";
/// Island, x, y, height.
const AXES: usize = 4;
/// R*Trees store floats of 32 bits, rounded outwards by up to a step of 2^-23.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// Puts a patch at its present place.
pub(crate) fn put(connection: &Connection, patch: &Patch, island: PatchId) -> rusqlite::Result<()> {
    let sql = format!("INSERT OR REPLACE INTO {NAME} VALUES (?,?,?,?,?,?,?,?,?)");
    let twice = coordinates(patch, island).into_iter().flat_map(|x| [x, x]);
    let row = [f64::from(patch.id.0)].into_iter().chain(twice);
    connection.prepare_cached(&sql)?.execute(params_from_iter(row))?;
    Ok(())
}

/// Where the base stood when the patch was taken; a height that nobody knows counts as 0.
fn coordinates(patch: &Patch, island: PatchId) -> [f64; AXES] {
    let pose = patch.island_from_patch;
    [f64::from(island.0), pose.x, pose.y, patch.elevation.map_or(0.0, |e| e.height_m)]
}

/// What differs from the patches.
pub(crate) fn problems(
    connection: &Connection,
    patches: &[Patch],
    islands: &[PatchId],
) -> rusqlite::Result<Vec<Finding>> {
    let mut statement = connection.prepare(&format!("SELECT * FROM {NAME} ORDER BY patch"))?;
    let mut rows = statement.query([])?;
    let (mut count, mut wrong) = (0, 0);
    while let Some(row) = rows.next()? {
        let place = patches.get(count).filter(|p| row.get(0) == Ok(i64::from(p.id.0)));
        let right = match place {
            Some(patch) => holds(row, coordinates(patch, islands[count]))?,
            None => false,
        };
        wrong += usize::from(!right);
        count += 1;
    }
    let mut findings = Vec::new();
    if wrong > 0 || count != patches.len() {
        let problem = format!("{count} places of {} patches, {wrong} wrong", patches.len());
        findings.push(Finding { place: NAME.into(), problem });
    }
    Ok(findings)
}

/// True when a row's box is the point, but for rounding.
fn holds(row: &rusqlite::Row, point: [f64; AXES]) -> rusqlite::Result<bool> {
    for (axis, at) in point.into_iter().enumerate() {
        let (low, high): (f64, f64) = (row.get(1 + 2 * axis)?, row.get(2 + 2 * axis)?);
        // Numbers below the least normal float are rounded by more than their size.
        let slack = at.abs() * ROUNDING + f64::from(f32::MIN_POSITIVE);
        if !(low <= at && at <= high && high - low <= 2.0 * slack) {
            return Ok(false);
        }
    }
    Ok(true)
}
