//! Arithmetic that an iteration cannot avoid: what a time is measured against.
//!
//! One multiplication with its addition counts 2; matrix products, and the interpolation
//! of learned grids between the corners of their cells, are counted, for each number
//! once: activations that are computed again for the
//! backward pass, and distances that tell which samples matter, do not count
//! twice.

use crate::model::ModelConfig;
use neat_tensor::PositionalEncoding;
use serde::Serialize;

/// Rows that went through the networks in one iteration.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StepRows {
    /// Points at which the sampler asked for a distance.
    pub sampler: usize,
    /// Samples whose distance was rendered.
    pub samples: usize,
    /// Samples at which all networks were evaluated.
    pub full: usize,
    /// … of rays that carry a segment.
    pub segment: usize,
    /// Points of the eikonal term besides rendered samples.
    pub eikonal: usize,
    /// Points of shells outside the scene ball.
    pub background: usize,
}

impl std::ops::AddAssign for StepRows {
    fn add_assign(&mut self, other: Self) {
        self.sampler += other.sampler;
        self.samples += other.samples;
        self.full += other.full;
        self.segment += other.segment;
        self.eikonal += other.eikonal;
        self.background += other.background;
    }
}

impl StepRows {
    /// The mean of `steps` iterations that were added up.
    pub fn divided_by(self, steps: usize) -> Self {
        Self {
            sampler: self.sampler / steps,
            samples: self.samples / steps,
            full: self.full / steps,
            segment: self.segment / steps,
            eikonal: self.eikonal / steps,
            background: self.background / steps,
        }
    }
}

/// Floating-point operations of one iteration.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct StepFlops {
    /// Distances for the sampler.
    pub sampler: f64,
    /// Distances, gradients, colours and segments.
    pub forward: f64,
    /// Gradients of the parameters.
    pub backward: f64,
}

impl std::ops::AddAssign for StepFlops {
    fn add_assign(&mut self, other: Self) {
        self.sampler += other.sampler;
        self.forward += other.forward;
        self.backward += other.backward;
    }
}

impl StepFlops {
    /// All of them.
    pub fn total(&self) -> f64 {
        self.sampler + self.forward + self.backward
    }

    /// Counts an iteration over `rows`.
    pub fn count(model: &ModelConfig, rows: &StepRows) -> Self {
        let implicit = &model.implicit;
        let encoded = |octaves: usize| PositionalEncoding { octaves }.output_width(3);
        let point = implicit.encoded();
        let hidden: usize = (0..implicit.hidden_layers)
            .map(|l| {
                let inputs = if l == 0 { point } else { implicit.width };
                let narrowed = implicit.skip_layer > 0 && implicit.skip_layer == l + 1;
                let outputs = implicit.width - if narrowed { point } else { 0 };
                inputs * outputs
            })
            .sum();
        let product = |size: usize| 2.0 * size as f64;
        // Each feature of a grid lies between eight corners, and so does its derivative
        // along each axis.
        let grid_width = implicit.encoding.width();
        let interpolation = |width: usize| product(8 * width);
        let interpolated = interpolation(grid_width);
        let distance = product(hidden + implicit.width) + interpolated;
        let features = product(implicit.width * implicit.features);
        let sweep = product(hidden) + 3.0 * interpolated;
        let outside = &model.background;
        let deep = outside.hidden_layers.saturating_sub(1) * outside.width * outside.width;
        let first = (3 + outside.encoding.width()) * outside.width;
        let light = product(first + deep + 4 * outside.width);
        let light_interpolated = interpolation(outside.encoding.width());
        // First layers alone pass a gradient to part of their inputs: to gradients,
        // features and grids, which then pass it to their table.
        let perceptron = |rays: usize, grid: usize, width: usize, layers: usize, out: usize| {
            let inputs = rays + 3 + implicit.features + grid;
            let deep = (layers - 1) * width * width + width * out;
            let forward = product(inputs * width + deep);
            let backward = 2.0 * forward - product(rays * width);
            (
                forward + interpolation(grid),
                backward + interpolation(grid),
            )
        };
        let radiance = perceptron(
            3 + encoded(model.rendering.view_octaves),
            model.rendering.encoding.width(),
            model.rendering.width,
            model.rendering.hidden_layers,
            3,
        );
        let view = if model.attraction.view_direction {
            3
        } else {
            0
        };
        let attraction = perceptron(
            encoded(model.attraction.octaves) + view,
            model.attraction.encoding.width(),
            model.attraction.width,
            model.attraction.hidden_layers,
            6,
        );
        // The first layer passes no gradient to the points, though to grids; these have no
        // other operand that wants one.
        let to_points = product((point - grid_width) * implicit.width) + interpolated;
        let of = |rows: usize, flops: f64| rows as f64 * flops;
        Self {
            sampler: of(rows.sampler, distance),
            forward: of(rows.samples, distance)
                + of(rows.full, features + sweep + radiance.0)
                + of(rows.segment, attraction.0)
                + of(rows.eikonal, distance + sweep)
                + of(rows.background, light + light_interpolated),
            backward: of(rows.samples, 2.0 * distance - to_points)
                + of(rows.full, 2.0 * features + 2.0 * sweep + radiance.1)
                + of(rows.segment, attraction.1)
                + of(rows.eikonal, 2.0 * sweep + 2.0 * distance - to_points)
                + of(rows.background, 2.0 * light + light_interpolated),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_tensor::{GridConfig, PointEncoding};

    #[test]
    fn a_paper_size_sample_takes_what_the_design_says() {
        let rows = StepRows {
            sampler: 1,
            samples: 1,
            full: 1,
            segment: 1,
            ..StepRows::default()
        };
        let flops = StepFlops::count(&ModelConfig::default(), &rows);
        // About 1 MFLOP a distance, 9.5 MFLOP for everything else of a sample.
        assert!((flops.sampler - 0.92e6).abs() < 0.05e6, "{flops:?}");
        let sample = flops.forward + flops.backward;
        assert!((sample - 9.5e6).abs() < 0.7e6, "{flops:?}");
    }

    #[test]
    fn a_grid_counts_its_columns_and_their_interpolation() {
        let rows = StepRows {
            sampler: 1,
            ..StepRows::default()
        };
        let mut model = ModelConfig::default();
        model.implicit.skip_layer = 0;
        let sines = StepFlops::count(&model, &rows).sampler;
        model.implicit.encoding = grid();
        let columns = 20.0;
        let more = 2.0 * columns * (256.0 + 8.0);
        assert_eq!(StepFlops::count(&model, &rows).sampler - sines, more);
    }

    #[test]
    fn grids_of_segments_and_colours_count_where_these_are_evaluated() {
        let rows = StepRows {
            full: 3,
            segment: 1,
            ..StepRows::default()
        };
        let sines = StepFlops::count(&ModelConfig::default(), &rows);
        let mut model = ModelConfig::default();
        let columns = 20.0;
        let more = 2.0 * columns * (256.0 + 8.0);
        model.attraction.encoding = grid();
        let segments = StepFlops::count(&model, &rows);
        assert_eq!(segments.forward - sines.forward, more);
        assert_eq!(
            segments.backward - sines.backward,
            more + 2.0 * columns * 256.0
        );
        model.rendering.encoding = grid();
        let colours = StepFlops::count(&model, &rows);
        assert_eq!(colours.forward - segments.forward, 3.0 * more);
    }

    fn grid() -> PointEncoding {
        PointEncoding::Grid(GridConfig {
            levels: 5,
            features: 4,
            ..GridConfig::default()
        })
    }
}
