//! Small learned grids of every kind.

use neat_tensor::GridConfig;
use neat_tensor::kernels::cpu::grid::GridShape;

/// Over a cube of half the side 1.5, two dense and one hashed: some normally distributed points lie
/// outside.
///
/// # Panics
/// If they were not so.
pub fn small_grids(features: usize) -> GridShape {
    let config = GridConfig {
        levels: 3,
        features,
        log2_entries: 8,
        coarsest: 2,
        finest: 11,
    };
    let shape = config.shape(1.5);
    let hashed = shape.levels.iter().filter(|level| level.mask.is_some());
    assert_eq!(hashed.count(), 1, "{shape:?}");
    shape
}
