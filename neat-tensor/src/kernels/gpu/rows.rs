//! Rows that are picked from a matrix, and sums of those that belong to the same row: each the
//! adjoint of the other.
//!
//! burn adds up rows in one unit per column, which goes through all of them. Here each sum has
//! its own unit, which knows by a table whose rows are its own.

use super::{elementwise, empty_of, launch_elementwise};
use crate::row_choice::RowChoice;
use burn::backend::TensorMetadata;
use burn::backend::ops::{FloatTensorOps, IntTensorOps};
use burn::tensor::TensorData;
use burn_cubecl::CubeBackend;
use burn_cubecl::cubecl::{self, prelude::*};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

/// `rows` `[M, C]`, added up: row `i` of `sums` is made of the rows `members[k]`, `k` from
/// `starts[i]` to `starts[i + 1]`. One unit per number.
#[cube(launch)]
fn add_up_kernel(
    rows: &Tensor<f32>,
    starts: &Tensor<u32>,
    members: &Tensor<u32>,
    sums: &mut Tensor<f32>,
    columns: usize,
) {
    if ABSOLUTE_POS < sums.len() {
        let row = ABSOLUTE_POS / columns;
        let column = ABSOLUTE_POS % columns;
        let mut sum = 0.0f32;
        for k in starts[row]..starts[row + 1] {
            sum += rows[members[k as usize] as usize * columns + column];
        }
        sums[ABSOLUTE_POS] = sum;
    }
}

/// Numbers on the device of `like`.
fn numbers(numbers: Vec<u32>, like: &CubeTensor) -> CubeTensor {
    let count = numbers.len();
    CubeBackend::int_from_data(TensorData::new(numbers, [count]), &like.device)
}

/// The rows `[M, C]` of `values` `[total, C]`.
pub(super) fn pick([values]: [CubeTensor; 1], choice: &RowChoice) -> CubeTensor {
    let indices = numbers(choice.indices().to_vec(), &values);
    CubeBackend::float_select(values, 0, indices)
}

/// The sums `[total, C]` of `rows` `[M, C]`.
pub(super) fn add_up([rows]: [CubeTensor; 1], choice: &RowChoice) -> CubeTensor {
    let columns = rows.shape()[1];
    let sums = empty_of(&rows, [choice.total(), columns]);
    let (starts, members) = members_of_rows(choice);
    let (starts, members) = (numbers(starts, &rows), numbers(members, &rows));
    let rows = into_contiguous(rows);
    launch_elementwise!(add_up_kernel, sums, [rows, starts, members], columns)
}

/// Which rows belong to each, in their order: those of row `i` from the `i`-th start to the
/// next.
fn members_of_rows(choice: &RowChoice) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0; choice.total() + 1];
    for row in choice.indices() {
        starts[*row as usize + 1] += 1;
    }
    for row in 0..choice.total() {
        starts[row + 1] += starts[row];
    }
    let mut next = starts.clone();
    let mut members = vec![0; choice.indices().len()];
    for (member, row) in choice.indices().iter().enumerate() {
        let place = &mut next[*row as usize];
        members[*place as usize] = member as u32;
        *place += 1;
    }
    (starts, members)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_keep_their_order() {
        let choice = RowChoice::new([3, 0, 3, 1, 0], 5);
        let (starts, members) = members_of_rows(&choice);
        assert_eq!(starts, [0, 2, 3, 3, 5, 5]);
        assert_eq!(members, [1, 4, 3, 0, 2]);
    }
}
