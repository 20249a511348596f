/// No cell.
pub(super) const NONE: u32 = u32::MAX;

/// Finds the up to four cells that a quarter belongs to: a hash table with open addressing, as it
/// is asked once for each point and step. Its size is a power of two, at most half of it used.
#[derive(Default)]
pub(super) struct Table {
    slots: Vec<((i32, i32), [u32; 4])>,
}

impl Table {
    /// An empty table for so many quarters at most.
    pub fn for_quarters(count: usize) -> Self {
        Table { slots: vec![((0, 0), [NONE; 4]); (2 * count).next_power_of_two().max(2)] }
    }

    /// Says that a quarter belongs to a cell, as the `corner`-th of its four.
    pub fn insert(&mut self, quarter: (i32, i32), corner: usize, cell: u32) {
        let slot = self.slot(quarter);
        self.slots[slot].0 = quarter;
        self.slots[slot].1[corner] = cell;
    }

    /// The cells of a quarter.
    pub fn cells(&self, quarter: (i32, i32)) -> [u32; 4] {
        if self.slots.is_empty() {
            return [NONE; 4];
        }
        self.slots[self.slot(quarter)].1
    }

    /// Where a quarter is, or would be.
    fn slot(&self, quarter: (i32, i32)) -> usize {
        let last = self.slots.len() - 1;
        let x = (quarter.0 as u32).wrapping_mul(0x9E37_79B1);
        let y = (quarter.1 as u32).wrapping_mul(0x85EB_CA77);
        let hash = x ^ y;
        let mut slot = (hash ^ (hash >> 15)) as usize & last;
        while self.slots[slot].1 != [NONE; 4] && self.slots[slot].0 != quarter {
            slot = (slot + 1) & last;
        }
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_in_is_found_and_nothing_else() {
        let quarters = || (-8..8).flat_map(|x| (-8..8).map(move |y| (x, 3 * y)));
        let mut table = Table::for_quarters(256);
        for (i, quarter) in quarters().enumerate() {
            table.insert(quarter, i % 4, i as u32);
        }
        for (i, quarter) in quarters().enumerate() {
            let mut expected = [NONE; 4];
            expected[i % 4] = i as u32;
            assert_eq!(table.cells(quarter), expected);
            assert_eq!(table.cells((quarter.0, quarter.1 + 1)), [NONE; 4]);
        }
        assert_eq!(Table::default().cells((0, 0)), [NONE; 4]);
    }
}
