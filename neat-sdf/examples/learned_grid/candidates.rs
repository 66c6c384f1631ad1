//! The fields that are compared.

use super::field::{Field, PresentNetwork};
use super::fit::Rates;
use super::grid::{Grid, GridShape, Interpolation};
use super::grid_network::GridNetwork;

/// Distance and 32 features, as in the `fast` preset.
pub const OUTPUTS: usize = 1 + 32;
/// Width of hidden layers.
const WIDTH: usize = 64;

/// A field with its name and learning rates.
pub struct Candidate {
    /// What the table calls it.
    pub name: &'static str,
    /// Whether it is the present network.
    pub is_present: bool,
    /// The field.
    pub field: Box<dyn Field>,
    /// Its learning rates.
    pub rates: Rates,
}

/// All of them, the present network first.
pub fn all() -> Vec<Candidate> {
    let perceptron = |name, hidden, octaves| Candidate {
        name,
        is_present: false,
        field: Box::new(PresentNetwork::new(hidden, WIDTH, octaves, OUTPUTS)),
        rates: Rates {
            layers: 5e-3,
            table: 0.0,
        },
    };
    let present = Candidate {
        is_present: true,
        ..perceptron("present", 4, 4)
    };
    let linear = GridShape {
        levels: 4,
        coarsest: 4,
        finest: 32,
        most_entries: 1 << 16,
        interpolation: Interpolation::Linear,
    };
    let smooth = GridShape {
        interpolation: Interpolation::Smooth,
        ..linear
    };
    let hashed = GridShape {
        finest: 64,
        most_entries: 1 << 14,
        ..smooth
    };
    let many_levels = GridShape {
        levels: 8,
        ..hashed
    };
    vec![
        present,
        perceptron("short", 2, 4),
        grid::<4>("linear", &linear, 1),
        grid::<4>("smooth", &smooth, 1),
        grid::<4>("smooth-2", &smooth, 2),
        grid::<4>("hashed", &hashed, 1),
        grid::<2>("8-levels", &many_levels, 1),
    ]
}

fn grid<const F: usize>(name: &'static str, shape: &GridShape, hidden: usize) -> Candidate {
    Candidate {
        name,
        is_present: false,
        field: Box::new(GridNetwork::<F>::new(
            Grid::new(shape),
            hidden,
            WIDTH,
            OUTPUTS,
        )),
        rates: Rates {
            layers: 5e-3,
            table: 1e-2,
        },
    }
}
