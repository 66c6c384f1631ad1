//! The grid network against finite differences of a twin in float64.

use super::field::{Adjoint, Field};
use super::grid::{EXTENT, Grid, GridShape, Interpolation};
use super::grid_network::{GridNetwork, SHARPNESS};
use neat_tensor::random::{Purpose, standard_normal, stream};
use rand::RngExt;

const FEATURES: usize = 2;
const OUTPUTS: usize = 3;
/// More than one block, the last not full.
const ROWS: usize = 50;
const STEP: f64 = 1e-5;

/// The network's outputs at one point, written down as plainly as possible.
fn outputs(
    shape: &GridShape,
    layers: &[[usize; 2]],
    parameters: &[f64],
    point: [f64; 3],
) -> Vec<f64> {
    let count = |layers: &[[usize; 2]]| layers.iter().map(|[i, o]| (i + 1) * o).sum::<usize>();
    let mut x = point.to_vec();
    let mut table = &parameters[count(layers)..];
    for l in 0..shape.levels {
        let cells = shape.cells(l);
        let corners = (cells + 1).pow(3);
        let entries = corners.min(shape.most_entries);
        let mut features = [0.0; FEATURES];
        for corner in 0..8 {
            let mut weight = 1.0;
            let index: [usize; 3] = std::array::from_fn(|k| {
                let position = (point[k] / f64::from(EXTENT) + 1.0) / 2.0 * cells as f64;
                let t = position.fract();
                let far = match shape.interpolation {
                    Interpolation::Linear => t,
                    Interpolation::Smooth => t * t * (3.0 - 2.0 * t),
                };
                let side = corner >> k & 1;
                weight *= if side == 1 { far } else { 1.0 - far };
                position as usize + side
            });
            let [i, j, k] = index;
            let entry = if corners <= shape.most_entries {
                (k * (cells + 1) + j) * (cells + 1) + i
            } else {
                let hash = i as u32
                    ^ (j as u32).wrapping_mul(2_654_435_761)
                    ^ (k as u32).wrapping_mul(805_459_861);
                hash as usize % shape.most_entries
            };
            for (f, feature) in features.iter_mut().enumerate() {
                *feature += weight * table[entry * FEATURES + f];
            }
        }
        x.extend(features);
        table = &table[entries * FEATURES..];
    }
    let mut rest = parameters;
    for (l, &[inputs, width]) in layers.iter().enumerate() {
        let (weight, tail) = rest.split_at(inputs * width);
        let z = weight
            .chunks(inputs)
            .zip(tail)
            .map(|(row, bias)| bias + row.iter().zip(&x).map(|(w, x)| w * x).sum::<f64>());
        let sharpness = f64::from(SHARPNESS);
        x = match l + 1 == layers.len() {
            true => z.collect(),
            false => z
                .map(|z| z.max(0.0) + (-sharpness * z.abs()).exp().ln_1p() / sharpness)
                .collect(),
        };
        rest = &tail[width..];
    }
    x
}

/// `Σ output · adjoint`, the gradient by central differences along its adjoint.
fn objective(
    shape: &GridShape,
    layers: &[[usize; 2]],
    parameters: &[f64],
    points: &[[f32; 3]],
    adjoint: &Adjoint,
) -> f64 {
    let rows = points.iter().zip(&adjoint.first).zip(&adjoint.gradient);
    rows.zip(adjoint.others.chunks_exact(OUTPUTS - 1))
        .map(|(((point, first), along), others)| {
            let at = |offset: f64| {
                let point =
                    std::array::from_fn(|k| f64::from(point[k]) + offset * f64::from(along[k]));
                outputs(shape, layers, parameters, point)
            };
            let here = at(0.0);
            let slope = (at(STEP)[0] - at(-STEP)[0]) / (2.0 * STEP);
            let others = here[1..].iter().zip(others).map(|(y, a)| y * f64::from(*a));
            here[0] * f64::from(*first) + slope + others.sum::<f64>()
        })
        .sum()
}

#[test]
fn derivatives_are_those_of_finite_differences() {
    for (interpolation, hidden) in [
        (Interpolation::Linear, 1),
        (Interpolation::Smooth, 1),
        (Interpolation::Smooth, 2),
    ] {
        let shape = GridShape {
            levels: 3,
            coarsest: 2,
            finest: 11,
            // The finest level shares entries.
            most_entries: 512,
            interpolation,
        };
        let grid = Grid::<FEATURES>::new(&shape);
        let mut network = GridNetwork::new(grid, hidden, 20, OUTPUTS);
        let layers: Vec<_> = network
            .layers()
            .iter()
            .map(|l| [l.inputs, l.outputs])
            .collect();
        let mut rng = stream(hidden as u64, Purpose::Weights, 0);
        let parameters: Vec<f32> = (0..network.parameters())
            .map(|_| 0.3 * standard_normal(&mut rng) as f32)
            .collect();
        let exact: Vec<f64> = parameters.iter().map(|p| f64::from(*p)).collect();
        let points: Vec<[f32; 3]> = (0..ROWS)
            .map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
            .collect();
        let mut numbers =
            |n: usize| -> Vec<f32> { (0..n).map(|_| standard_normal(&mut rng) as f32).collect() };
        let adjoint = Adjoint {
            first: numbers(ROWS),
            gradient: numbers(3 * ROWS).as_chunks().0.to_vec(),
            others: numbers((OUTPUTS - 1) * ROWS),
        };

        let output = network.forward(&parameters, points.as_flattened());
        let alone = network.distances(&parameters, points.as_flattened());
        for (row, point) in points.iter().enumerate() {
            let at = |point: [f64; 3]| outputs(&shape, &layers, &exact, point);
            let point = point.map(f64::from);
            let here = at(point);
            close(output.first[row], here[0], "distance");
            close(alone[row], here[0], "distance alone");
            close(output.others[row * (OUTPUTS - 1)], here[1], "feature");
            for axis in 0..3 {
                let [mut before, mut after] = [point; 2];
                before[axis] -= STEP;
                after[axis] += STEP;
                let slope = (at(after)[0] - at(before)[0]) / (2.0 * STEP);
                close(output.gradient[row][axis], slope, "gradient");
            }
        }

        let mut gradient = vec![0.0; parameters.len()];
        network.backward(&parameters, points.as_flattened(), &adjoint, &mut gradient);
        // Every seventh parameter, in layers and table alike.
        for p in (0..parameters.len()).step_by(7) {
            let at = |offset: f64| {
                let mut moved = exact.clone();
                moved[p] += offset;
                objective(&shape, &layers, &moved, &points, &adjoint)
            };
            let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            close(gradient[p], slope, "parameter");
        }
    }
}

fn close(found: f32, exact: f64, what: &str) {
    let error = (f64::from(found) - exact).abs();
    assert!(
        error < 2e-3 * (1.0 + exact.abs()),
        "{what}: {found} instead of {exact}"
    );
}
