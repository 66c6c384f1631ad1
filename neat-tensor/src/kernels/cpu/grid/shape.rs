//! The sizes of grids, and where in the table their entries are.

/// Several grids over one cube, and the table of their entries.
#[derive(Clone, Debug, PartialEq)]
pub struct GridShape {
    /// Coarsest first.
    pub levels: Vec<GridLevel>,
    /// Features per entry: 1, 2, 4 or 8.
    pub features: usize,
    /// Half the side of the cube around the origin.
    pub half_side: f32,
}

/// One grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridLevel {
    /// Cells along a side.
    pub cells: u32,
    /// Its first entry in the table.
    pub first: usize,
    /// Entries minus one, where corners share entries by a hash.
    pub mask: Option<u32>,
}

/// Factors of the second and third coordinate in the hash of a corner (Teschner et al.
/// 2003, as in Instant-NGP).
pub(crate) const HASH: [u32; 2] = [2_654_435_761, 805_459_861];

impl GridLevel {
    /// Number of its entries.
    pub fn entries(&self) -> usize {
        match self.mask {
            None => (self.cells as usize + 1).pow(3),
            Some(mask) => mask as usize + 1,
        }
    }
}

impl GridShape {
    /// Grids of `cells` along a side. A grid that has more than `most_entries` corners
    /// (a power of two) has so many entries, which its corners share.
    ///
    /// # Panics
    /// If `features` is none of 1, 2, 4, 8, or `most_entries` no power of two.
    pub fn new(cells: &[u32], features: usize, most_entries: usize, half_side: f32) -> Self {
        assert!(
            matches!(features, 1 | 2 | 4 | 8) && most_entries.is_power_of_two(),
            "GridShape::new: {features} features, {most_entries} entries"
        );
        let mut first = 0;
        let levels = cells.iter().map(|cells| {
            let corners = (*cells as usize + 1).pow(3);
            let level = GridLevel {
                cells: *cells,
                first,
                mask: (corners > most_entries).then(|| most_entries as u32 - 1),
            };
            first += level.entries();
            level
        });
        Self {
            levels: levels.collect(),
            features,
            half_side,
        }
    }

    /// Features of a point, of all grids.
    pub fn width(&self) -> usize {
        self.levels.len() * self.features
    }

    /// Entries of the table.
    pub fn entries(&self) -> usize {
        self.levels.iter().map(GridLevel::entries).sum()
    }

    /// Cells per unit of length in `level`.
    pub(crate) fn scale(&self, level: &GridLevel) -> f32 {
        level.cells as f32 / (2.0 * self.half_side)
    }
}
