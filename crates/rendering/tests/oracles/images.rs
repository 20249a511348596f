use crate::worlds::{grid, recorded, views, with_threads};
use geometry::{Pose2, Vector2};
use manifoldslam_rendering::{
    Annotations, Cell, ClosureMark, GridFrame, MarkKind, OccupancyGrid, RenderError, Trajectory,
    contact_sheet_png, map_png,
};

struct Image {
    width: usize,
    height: usize,
    rgb: Vec<[u8; 3]>,
}

fn decode(bytes: &[u8]) -> Image {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut pixels).expect("a frame");
    let rgb = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    Image { width: info.width as usize, height: info.height as usize, rgb }
}

impl Image {
    fn at(&self, column: usize, row: usize) -> [u8; 3] {
        self.rgb[row * self.width + column]
    }

    fn count(&self, color: [u8; 3]) -> usize {
        self.rgb.iter().filter(|c| **c == color).count()
    }
}

const BARE: Annotations = Annotations {
    title: None,
    trajectories: &[],
    patches: &[],
    closures: &[],
    scale_bar: false,
    legend: false,
    north_arrow: false,
    zoom: Some(1),
};

fn patterned(width: usize, height: usize) -> OccupancyGrid {
    let size = Vector2::new(width as f64, height as f64) * 0.5;
    let frame = GridFrame::covering(Vector2::zeros(), size, 0.5).expect("a frame");
    let kinds = [Cell::Unknown, Cell::Free, Cell::Occupied];
    let cells = (0..frame.len()).map(|i| kinds[(i * i + i / 7) % 3]).collect();
    OccupancyGrid::from_cells(frame, cells)
}

/// A bare map read back gives every cell, the highest row first.
#[test]
fn pixels_are_cells() {
    let grid = patterned(37, 23);
    for zoom in [1, 3] {
        let image = decode(&map_png(&grid, &Annotations { zoom: Some(zoom), ..BARE }).expect("ok"));
        assert_eq!((image.width, image.height), (37 * zoom, 23 * zoom));
        for (c, r) in (0..23 * zoom).flat_map(|r| (0..37 * zoom).map(move |c| (c, r))) {
            let expected = match grid.cell(c / zoom, 22 - r / zoom) {
                Cell::Unknown => [198, 211, 226],
                Cell::Free => [255, 255, 255],
                Cell::Occupied => [0, 0, 0],
            };
            assert_eq!(image.at(c, r), expected);
        }
    }
}

#[test]
fn a_path_is_drawn_where_it_went() {
    let grid = patterned(300, 200);
    // Along the middle of row 60.
    let poses = [Pose2::new(20.0, 30.25, 0.0), Pose2::new(120.0, 30.25, 0.0)];
    let trajectories = [Trajectory { name: "one", poses: &poses }];
    let image =
        decode(&map_png(&grid, &Annotations { trajectories: &trajectories, ..BARE }).expect("ok"));
    let blue = [0, 95, 215];
    assert_eq!(image.at(200, 199 - 60), blue);
    assert_eq!(image.at(40, 199 - 60), blue, "the start marker");
    assert_ne!(image.at(245, 199 - 60), blue);
    assert_ne!(image.at(200, 199 - 70), blue);
}

#[test]
fn legends_name_what_is_drawn() {
    let grid = patterned(400, 300);
    let poses = [Pose2::new(20.0, 30.25, 0.0), Pose2::new(120.0, 30.25, 0.0)];
    let trajectories = [Trajectory { name: "robot 1", poses: &poses }; 9];
    let closure = ClosureMark {
        from: Vector2::new(30.0, 60.25),
        to: Vector2::new(90.0, 60.25),
        kind: MarkKind::Closure,
    };
    let closures = [closure, ClosureMark { kind: MarkKind::Rejected, ..closure }];
    let all = Annotations {
        title: Some("A title \u{2013} with \u{1f600} and \n control"),
        trajectories: &trajectories,
        patches: &poses,
        closures: &closures,
        scale_bar: true,
        legend: true,
        north_arrow: true,
        zoom: Some(1),
    };
    let image = decode(&map_png(&grid, &all).expect("ok"));
    assert!(image.height > 300, "a strip below the map");
    let (green, ink) = ([0, 145, 70], [34, 40, 49]);
    assert!(image.count(green) > 60, "the accepted closure, on top of the rejected one");
    assert!(image.count(ink) > 100, "text");
    let plain = decode(&map_png(&grid, &BARE).expect("ok"));
    assert_eq!((plain.height, plain.count(ink)), (300, 0));
}

/// Anything may stand in the annotations; drawing clips it.
#[test]
fn wild_annotations_are_harmless() {
    let grid = patterned(40, 30);
    let wild = |v: f64| Pose2 { x: v, y: -v, yaw: v };
    let poses: Vec<Pose2> =
        [f64::NAN, f64::INFINITY, 1e300, -1e9, 3.0, 1e9, -0.0].map(wild).to_vec();
    let trajectories = [Trajectory { name: "\u{0}\u{fffd}", poses: &poses }];
    let far = Vector2::repeat(1e12);
    let closures = MarkKind::ALL.map(|kind| ClosureMark { from: -far, to: far, kind });
    let annotations = Annotations {
        title: Some(""),
        trajectories: &trajectories,
        patches: &poses,
        closures: &closures,
        zoom: Some(usize::MAX),
        ..Annotations::default()
    };
    // A zoom beyond the limit on pixels is reduced, not obeyed.
    let small = OccupancyGrid::from_cells(*patterned(4, 3).frame(), vec![]);
    assert!(map_png(&grid, &Annotations { zoom: Some(2), ..annotations }).is_ok());
    assert!(map_png(&small, &Annotations { zoom: Some(50), ..annotations }).is_ok());
}

#[test]
fn images_do_not_depend_on_threads() {
    let (scans, poses) = recorded(6);
    let views = views(&scans, &poses);
    let frame = GridFrame::around(&views, 0.5, 0.05).expect("a frame");
    let trajectories = [Trajectory { name: "robot", poses: &poses }];
    let annotations = Annotations { trajectories: &trajectories, ..Annotations::default() };
    let draw = || map_png(&grid(frame, &views), &annotations).expect("ok");
    let one = with_threads(1, draw);
    assert_eq!(one, with_threads(2, draw));
    assert_eq!(one, with_threads(3, draw));
}

/// Every map of a sheet is drawn as it is alone; three stand in two rows.
#[test]
fn a_sheet_holds_its_maps() {
    let grids = [patterned(40, 30), patterned(33, 25), patterned(20, 30)];
    let maps: Vec<_> = grids.iter().map(|grid| (grid, BARE)).collect();
    let sheet = decode(&contact_sheet_png(&maps).expect("a sheet"));
    let zoom = 1000 / 40;
    let gap = sheet.width - 2 * 40 * zoom;
    assert_eq!(sheet.height, 2 * 30 * zoom + gap);
    let places = [(0, 0), (40 * zoom + gap, 0), (0, 30 * zoom + gap)];
    for (grid, (left, top)) in grids.iter().zip(places) {
        let alone = map_png(grid, &Annotations { zoom: Some(zoom), ..BARE }).expect("a map");
        let alone = decode(&alone);
        for (c, r) in (0..alone.height).flat_map(|r| (0..alone.width).map(move |c| (c, r))) {
            assert_eq!(sheet.at(left + c, top + r), alone.at(c, r));
        }
    }
    assert_eq!(contact_sheet_png(&[]), Err(RenderError::Empty));
}
