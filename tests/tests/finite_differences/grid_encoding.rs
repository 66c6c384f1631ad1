//! Learned grids: features, their pull-back, and how both change with points and table.

use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use neat_tensor::GridEncoding;
use neat_tests::backends::flex;
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::{
    STEP, assert_differentiates, central_differences, constant, normal,
};
use neat_tests::grids::small_grids;
use neat_tests::tensors::{float64, numbers};

const POINTS: usize = 7;

/// Grids whose entries are of the size of their sums.
pub fn random_grid(features: usize) -> GridEncoding {
    let shape = small_grids(features);
    let size = [shape.entries(), features];
    let values: Vec<f32> = normal(size[0] * features, 31)
        .into_iter()
        .map(|x| x as f32)
        .collect();
    GridEncoding {
        table: Param::from_data(TensorData::new(values, size), &flex()),
        shape,
    }
}

/// The same with its table in float64.
fn grid(features: usize) -> GridEncoding {
    let grid = random_grid(features);
    let table = grid.table.val().into_data().convert::<f64>();
    with_table(&grid, Tensor::from_data(table, float64(&flex())))
}

fn with_table(grid: &GridEncoding, table: Tensor<2>) -> GridEncoding {
    GridEncoding {
        table: Param::from_tensor(table),
        shape: grid.shape.clone(),
    }
}

fn weighted(t: Tensor<2>, seed: u64) -> Tensor<1> {
    let [rows, columns] = t.dims();
    (t.square() * constant(normal(rows * columns, seed), [rows, columns])).sum()
}

#[test]
fn the_pull_back_is_the_gradient_of_the_features() {
    for features in [1, 2, 4, 8] {
        let grid = grid(features);
        let width = grid.shape.width();
        let gradient = constant(normal(POINTS * width, 12), [POINTS, width]);
        let x = normal(3 * POINTS, 11);
        let pulled = grid.pull_back(constant(x.clone(), [POINTS, 3]), gradient.clone());
        let differences = central_differences(&x, |x| {
            let features = grid.encode(constant(x, [POINTS, 3]));
            numbers((features * gradient.clone()).sum())[0]
        });
        assert_relatively_close("pulled back", &numbers(pulled), &differences, 1e-7);
    }
}

#[test]
fn features_and_pull_back_differentiate_in_everything() {
    for features in [1, 2, 4, 8] {
        let grid = grid(features);
        let width = grid.shape.width();
        let x = normal(3 * POINTS, 11);
        let gradient = normal(POINTS * width, 12);
        let [of_points, of_features] = [[POINTS, 3], [POINTS, width]];
        let both = |grid: &GridEncoding, x: Tensor<2>, gradient: Tensor<2>| {
            weighted(grid.encode(x.clone()), 21) + weighted(grid.pull_back(x, gradient), 22)
        };
        assert_differentiates("points", &x, of_points, 1e-6, |x| {
            both(&grid, x, constant(gradient.clone(), of_features))
        });
        assert_differentiates("gradient", &gradient, of_features, 1e-6, |gradient| {
            both(&grid, constant(x.clone(), of_points), gradient)
        });
        if features > 2 {
            // Its numbers would take long, one by one.
            continue;
        }
        let table = numbers(grid.table.val());
        assert_differentiates("table", &table, grid.table.dims(), 1e-6, |table| {
            let x = constant(x.clone(), of_points);
            let gradient = constant(gradient.clone(), of_features);
            both(&with_table(&grid, table), x, gradient)
        });
    }
}

/// A cell's border is no place at which the gradient jumps.
#[test]
fn the_gradient_is_continuous_across_cells() {
    let grid = grid(2);
    let width = grid.shape.width();
    let gradient = constant(normal(width, 12), [1, width]);
    // The border between two cells of the coarsest grid, and of no other.
    let at = |x: f64| {
        let point = constant(vec![x, 0.31, -0.42], [1, 3]);
        numbers(grid.pull_back(point, gradient.clone()))
    };
    assert_relatively_close("across", &at(-STEP), &at(STEP), 1e-4);
}
