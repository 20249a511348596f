use super::building::{Building, LANDING};
use super::{Ascent, Storeys};

type Point = (f64, f64);

impl Building {
    /// Waypoints through all storeys and back, and the height of the first.
    pub fn route(&self, spec: &Storeys) -> (Vec<Point>, f64) {
        let top = spec.storeys.saturating_sub(1);
        let mut way = self.round();
        if spec.from_the_top {
            for storey in (0..top).rev() {
                way.extend(self.down());
                way.extend(if storey == 0 { self.round() } else { self.crossing() });
            }
            for _ in 0..top {
                way.extend(self.up());
                way.extend(self.round());
            }
            return (way, top as f64 * spec.height_m);
        }
        for _ in 0..top {
            way.extend(self.up());
            way.extend(self.round());
        }
        for _ in 0..top {
            way.extend(self.down());
            way.extend(self.crossing());
        }
        (way, 0.0)
    }

    /// Once around the block from its north-western corner, into a room, and on along the south.
    fn round(&self) -> Vec<Point> {
        let east = self.width - 1.5;
        let room = 0.4 * self.width / 3.0 + 0.45;
        vec![
            (1.5, 12.0),
            (1.5, 6.1),
            (room - 0.4, 6.0),
            (room, 5.2),
            (room, 3.4),
            (room + 0.1, 5.2),
            (room + 0.6, 6.0),
            (east, 6.0),
            (east, 12.0),
            (1.6, 12.0),
            (1.5, 6.0),
            (0.4 * self.width, 6.1),
        ]
    }

    /// Along the north to the east and back through the south.
    fn crossing(&self) -> Vec<Point> {
        let east = self.width - 1.5;
        vec![(1.5, 12.0), (east, 12.0), (east, 6.0), (0.4 * self.width, 6.0)]
    }

    /// From the south up to the next storey.
    fn up(&self) -> Vec<Point> {
        let (lane, end) = (self.first_lane(), self.ramp_end + 0.5 * LANDING);
        let mut way = vec![(1.5, 6.2), (1.5, 12.0), (1.5, lane), (LANDING, lane)];
        match self.ascent {
            Ascent::Straight => {
                let east = self.width - 1.5;
                way.extend([(east - 0.4, lane), (east, lane - 0.3), (east, 12.0)]);
            }
            Ascent::Turning => way.extend(self.turned(end)),
        }
        way
    }

    /// Down to the storey below.
    fn down(&self) -> Vec<Point> {
        let (lane, end) = (self.first_lane(), self.ramp_end + 0.5 * LANDING);
        match self.ascent {
            Ascent::Straight => {
                let east = self.width - 1.5;
                vec![(east, 6.0), (east, 12.0), (east, lane), (1.6, lane), (1.5, 12.0)]
            }
            Ascent::Turning => {
                let mut way = vec![(1.5, 6.0), (1.5, 12.0), (1.5, lane)];
                let mut turned = self.turned(end);
                turned.reverse();
                way.extend(turned);
                way.extend([(LANDING, lane), (1.6, lane), (1.5, 12.0)]);
                way
            }
        }
    }

    /// From the first lane's end around the landing and up the second lane.
    fn turned(&self, end: f64) -> Vec<Point> {
        let (first, second) = (self.first_lane(), self.second_lane());
        vec![
            (end, first),
            (end, second),
            (LANDING, second),
            (1.5, second),
            (1.5, first),
            (1.5, 12.0),
        ]
    }
}
