//! Arrays that are not what a reader expects, for the tests of layouts in `.npz`.

use crate::npz::NpyArray;
use proptest::prelude::*;

/// An array of mostly that shape, of small integers, of which some are replaced by
/// other numbers.
pub(crate) fn awkward_array(shape: Vec<usize>) -> impl Strategy<Value = NpyArray> {
    let other = prop::collection::vec(0..5usize, 0..4);
    let shape = prop_oneof![9 => Just(shape), 1 => other];
    shape.prop_flat_map(|shape| {
        let number = prop_oneof![
            20 => (-2..3i8).prop_map(f64::from),
            1 => any::<f64>(),
            1 => prop::num::f64::SUBNORMAL,
            1 => Just(1e308),
        ];
        let values = prop::collection::vec(number, shape.iter().product::<usize>());
        values.prop_map(move |values| NpyArray {
            shape: shape.clone(),
            values,
        })
    })
}
