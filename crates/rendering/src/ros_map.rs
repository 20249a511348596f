use crate::{Cell, OccupancyGrid};

/// The map as a binary PGM for ROS map_server in trinary mode: 254 free, 205 unknown, 0 occupied,
/// top row first.
pub fn ros_map_pgm(grid: &OccupancyGrid) -> Vec<u8> {
    let frame = grid.frame();
    let mut bytes = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
    bytes.reserve(frame.len());
    for row in (0..frame.height).rev() {
        bytes.extend(grid.row(row).iter().map(|cell| match cell {
            Cell::Free => 254_u8,
            Cell::Unknown => 205,
            Cell::Occupied => 0,
        }));
    }
    bytes
}

/// The YAML file that belongs to [`ros_map_pgm`]; `image` is the PGM's file name.
///
/// `origin` is the map-frame pose of the lower-left corner of the lower-left cell.
pub fn ros_map_yaml(grid: &OccupancyGrid, image: &str) -> String {
    let frame = grid.frame();
    // map_server reads 205 as (255 - 205) / 255 = 0.19608 occupied: only thresholds around it keep
    // it unknown.
    format!(
        "image: {}\nmode: trinary\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.196\n",
        serde_json::Value::from(image),
        yaml_number(frame.resolution_m),
        yaml_number(frame.origin.x),
        yaml_number(frame.origin.y),
    )
}

/// Nanometres are enough, and keep 0.1 + 0.2 from showing.
fn yaml_number(value: f64) -> String {
    let text = format!("{value:.9}");
    let text = text.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_owned() }
}
