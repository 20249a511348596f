use geometry::{Pose2, Vector2};
use manifoldslam_rendering::{
    Annotations, Cell, ClosureMark, GridFrame, MarkKind, OccupancyGrid, Report, Trajectory,
    map_svg, ros_map_pgm, ros_map_yaml, wall_outlines,
};
use proptest::prelude::*;
use serde_json::json;

fn grid_of(width: usize, height: usize, cells: Vec<Cell>) -> OccupancyGrid {
    let origin = Vector2::new(-3.0, 2.0);
    let size = Vector2::new(width as f64, height as f64) * 0.25;
    let frame = GridFrame::covering(origin, origin + size, 0.25).expect("a frame");
    OccupancyGrid::from_cells(frame, cells)
}

#[test]
fn pgm_reads_back() {
    let kinds = [Cell::Unknown, Cell::Free, Cell::Occupied];
    let grid = grid_of(7, 5, (0..35).map(|i| kinds[i % 3]).collect());
    let pgm = ros_map_pgm(&grid);
    let header = b"P5\n7 5\n255\n";
    assert!(pgm.starts_with(header));
    let pixels = &pgm[header.len()..];
    assert_eq!(pixels.len(), 35);
    for (i, &pixel) in pixels.iter().enumerate() {
        // map_server, trinary mode: occupied above 0.65, free below 0.196.
        let occupancy = f64::from(255 - pixel) / 255.0;
        let read = match occupancy {
            p if p > 0.65 => Cell::Occupied,
            p if p < 0.196 => Cell::Free,
            _ => Cell::Unknown,
        };
        assert_eq!(read, grid.cell(i % 7, 4 - i / 7));
    }
}

#[test]
fn yaml_says_where_the_map_lies() {
    let yaml = ros_map_yaml(&grid_of(7, 5, vec![]), "my \"map\".pgm");
    let expected = "image: \"my \\\"map\\\".pgm\"\nmode: trinary\nresolution: 0.25\n\
                    origin: [-3.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    assert_eq!(yaml, expected);
}

/// Twice the area to the left of a closed ring.
fn doubled_area(ring: &[Vector2<f64>]) -> f64 {
    ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| a.perp(b)).sum()
}

proptest! {
    /// The outlines enclose exactly what marching squares give each group of four cells.
    #[test]
    fn outlines_enclose_the_walls(
        (width, height, walls) in (1..12_usize, 1..12_usize).prop_flat_map(|(w, h)| {
            (Just(w), Just(h), prop::collection::vec(any::<bool>(), w * h))
        })
    ) {
        let cells: Vec<Cell> =
            walls.iter().map(|w| if *w { Cell::Occupied } else { Cell::Free }).collect();
        let grid = grid_of(width, height, cells);
        let occupied = |c: isize, r: isize| {
            let inside = (0..width as isize).contains(&c) && (0..height as isize).contains(&r);
            inside && walls[r as usize * width + c as usize]
        };
        let mut eighths = 0;
        for (c, r) in (-1..height as isize).flat_map(|r| (-1..width as isize).map(move |c| (c, r))) {
            let square = [occupied(c, r), occupied(c + 1, r), occupied(c + 1, r + 1), occupied(c, r + 1)];
            eighths += match square.iter().filter(|o| **o).count() {
                0 => 0,
                1 => 1,
                2 if square[0] == square[2] => 6,
                2 => 4,
                3 => 7,
                _ => 8,
            };
        }
        let area: f64 = wall_outlines(&grid, 0.0).iter().map(|r| doubled_area(r) / 2.0).sum();
        let expected = f64::from(eighths) / 8.0 * 0.25 * 0.25;
        prop_assert!((area - expected).abs() < 1e-9, "{area} instead of {expected}");
    }
}

#[test]
fn a_block_becomes_a_rectangle() {
    let block = |i: usize| (2..10).contains(&(i % 12)) && (3..7).contains(&(i / 12));
    let cells = (0..120).map(|i| if block(i) { Cell::Occupied } else { Cell::Unknown }).collect();
    let rings = wall_outlines(&grid_of(12, 10, cells), 0.12);
    assert_eq!(rings.len(), 1);
    assert!(rings[0].len() <= 8, "{:?}", rings[0]);
    for p in &rings[0] {
        assert!(p.x > -2.51 && p.x < -0.49 && p.y > 2.74 && p.y < 3.76, "{p}");
    }
}

fn decorated() -> (OccupancyGrid, Vec<Pose2>, Vec<ClosureMark>) {
    let cells = (0..120).map(|i| if i % 12 == 5 { Cell::Occupied } else { Cell::Free }).collect();
    let poses = vec![Pose2::new(-2.0, 3.0, 0.0), Pose2::new(-1.0, 4.0, 0.0)];
    let mark = |kind| ClosureMark { from: Vector2::new(-2.0, 3.0), to: Vector2::zeros(), kind };
    (grid_of(12, 10, cells), poses, MarkKind::ALL.map(mark).to_vec())
}

/// Every tag that opens closes, in order; returns the names seen.
fn check_tags(markup: &str, void: &[&str]) -> Vec<String> {
    let (mut open, mut seen) = (Vec::new(), Vec::new());
    let mut rest = markup;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a closed tag");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        let name = tag.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap_or_default();
        if tag.starts_with('!') || tag.ends_with('/') || void.contains(&name) {
            seen.push(name.to_owned());
        } else if tag.starts_with('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "in {markup}");
        } else {
            open.push(name.to_owned());
            seen.push(name.to_owned());
        }
    }
    assert!(open.is_empty(), "{open:?} left open");
    seen
}

#[test]
fn svg_is_metric_and_well_formed() {
    let (grid, poses, closures) = decorated();
    let trajectories = [Trajectory { name: "<robot & \"co\">", poses: &poses }];
    let annotations = Annotations {
        title: Some("a < b"),
        trajectories: &trajectories,
        patches: &poses,
        closures: &closures,
        ..Annotations::default()
    };
    let svg = map_svg(&grid, &annotations, 0.05);
    assert!(svg.contains("viewBox=\"-3 -4.5 3 2.5\""), "{svg}");
    assert!(svg.contains("M-2 -3L-1 -4"), "the path, y up: {svg}");
    assert!(svg.contains("&lt;robot &amp; &quot;co&quot;&gt;"));
    let tags = check_tags(&svg, &[]);
    // The start, two patches, and both ends of a landmark closure, a merge, a rendezvous and a
    // landmark.
    assert_eq!(tags.iter().filter(|t| *t == "circle").count(), 3 + 8);
}

#[test]
fn reports_are_whole_safe_and_alone() {
    let (grid, poses, closures) = decorated();
    let trajectories = [Trajectory { name: "<script>alert(1)</script>", poses: &poses }];
    let annotations =
        Annotations { trajectories: &trajectories, closures: &closures, ..Annotations::default() };
    let mut report = Report::new("Run of <b>today</b>");
    report.heading("Map").map(&grid, &annotations).expect("an image");
    report.paragraph("a & b").table(&["log", "error"], &[vec!["x<y".into(), "0.5".into()]]);
    let mut deep = json!("bottom");
    for _ in 0..200 {
        deep = json!({ "in": [deep] });
    }
    report.values(&json!({
        "time_secs": { "front end": 1.234_567_891, "<tag>": null },
        "closures": [{ "a": 1, "b": "<i>" }, { "a": 2, "c": true }],
        "plain": [1, 2.5, "three"],
        "deep": deep,
        "empty": [],
    }));
    let html = report.to_html();
    let tags = check_tags(&html, &["meta", "input", "br"]);
    for forbidden in ["script", "b", "i", "tag", "link", "iframe"] {
        assert!(!tags.iter().any(|t| t == forbidden), "<{forbidden}>");
    }
    let hosts = html.match_indices("://").map(|(i, _)| &html[i..(i + 20).min(html.len())]);
    assert!(hosts.into_iter().all(|h| h.starts_with("://www.w3.org/2000/s")), "only name spaces");
    assert!(html.contains("data:image/png;base64,iVBORw0KGgo"));
    assert!(html.contains("<td class=\"number\">1.23457</td>"), "six digits");
    assert!(html.contains("<th>time, s</th>"), "units");
    for kind in MarkKind::ALL {
        assert!(html.contains(&format!("{}: 1", kind.name())), "{kind:?} has a box");
    }
}
