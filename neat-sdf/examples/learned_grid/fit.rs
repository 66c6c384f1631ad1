//! Training a field on a shape, with the losses of a training step: distances in
//! place of renderings, and the eikonal term.

use super::field::{Adjoint, Field, Output, initial_parameters};
use super::shape::{Prism, Vector};
use neat_tensor::random::{Purpose, standard_normal, stream};
use rand::{Rng, RngExt};

/// Samples of a step.
pub const SAMPLES: usize = 1024;
/// Weight of the eikonal term, as in the `fast` preset.
const EIKONAL: f32 = 0.1;
/// Standard deviation of samples near the surface, along each axis.
const NEAR: f64 = 0.05;
/// How far from the surface [`Evidence::Observed`] knows the distance.
const BAND: f32 = 0.05;
/// Its error there.
const NOISE: f64 = 0.01;
/// Adam's decay rates and the guard against division by zero.
const BETA: [f32; 2] = [0.9, 0.99];
const EPSILON: f32 = 1e-8;
/// Numbers that Adam passes over where all their gradients are zero.
const LINE: usize = 16;

/// What is known of the shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// The exact distance everywhere.
    Exact,
    /// What photographs give: near the surface the distance with an error, beyond
    /// only which side a point is on. The eikonal term must do the rest.
    Observed,
}

/// Learning rates: of the perceptron and of the table.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Of the perceptron.
    pub layers: f32,
    /// Of the table.
    pub table: f32,
}

/// Points of a step, with the true distances as far as they are known.
struct Batch {
    points: Vec<f32>,
    targets: Vec<f32>,
}

/// A field in training.
pub struct Training<'a> {
    field: &'a mut dyn Field,
    /// Its parameters.
    pub parameters: Vec<f32>,
    gradient: Vec<f32>,
    moments: [Vec<f32>; 2],
    step: i32,
}

impl<'a> Training<'a> {
    /// Before the first step.
    pub fn new(field: &'a mut dyn Field, seed: u64) -> Self {
        let parameters = initial_parameters(field, &mut stream(seed, Purpose::Weights, 0));
        let zeros = || vec![0.0; parameters.len()];
        Self {
            gradient: zeros(),
            moments: [zeros(), zeros()],
            step: 0,
            field,
            parameters,
        }
    }

    /// One step at `points` with the adjoint that `loss` has there.
    pub fn step(&mut self, points: &[f32], rates: Rates, loss: impl FnOnce(&Output) -> Adjoint) {
        let output = self.field.forward(&self.parameters, points);
        let adjoint = loss(&output);
        self.gradient.fill(0.0);
        self.field
            .backward(&self.parameters, points, &adjoint, &mut self.gradient);
        self.step += 1;
        let correction = [0, 1].map(|i| 1.0 - BETA[i].powi(self.step));
        let scale = correction[1].sqrt() / correction[0];
        let table = self.field.table();
        self.adam(0..table.start, rates.layers * scale, correction[1].sqrt());
        self.adam(table, rates.table * scale, correction[1].sqrt());
    }

    /// Lines without any gradient keep their moments: most of a table is not met
    /// in a step, and need not travel through memory.
    fn adam(&mut self, range: std::ops::Range<usize>, rate: f32, root_correction: f32) {
        let [first, second] = &mut self.moments;
        for (((values, gradient), first), second) in self.parameters[range.clone()]
            .chunks_mut(LINE)
            .zip(self.gradient[range.clone()].chunks(LINE))
            .zip(first[range.clone()].chunks_mut(LINE))
            .zip(second[range].chunks_mut(LINE))
        {
            if gradient.iter().all(|g| *g == 0.0) {
                continue;
            }
            for (((x, g), m), v) in values.iter_mut().zip(gradient).zip(first).zip(second) {
                *m = BETA[0] * *m + (1.0 - BETA[0]) * g;
                *v = BETA[1] * *v + (1.0 - BETA[1]) * g * g;
                *x -= rate * *m / (v.sqrt() + EPSILON * root_correction);
            }
        }
    }
}

/// Trains `field` on `shape` for `steps` steps; gives the parameters.
pub fn fit(
    field: &mut dyn Field,
    shape: &Prism,
    evidence: Evidence,
    rates: Rates,
    steps: usize,
    seed: u64,
) -> Vec<f32> {
    let mut training = Training::new(field, seed);
    for step in 0..steps {
        let mut rng = stream(seed, Purpose::Samples, step as u64);
        let batch = Batch::new(shape, evidence, &mut rng);
        // As in the `fast` preset: a tenth to warm up, then down to a tenth.
        let share = step as f32 / steps as f32;
        let factor = (10.0 * share).min(1.0) * 0.1f32.powf(share);
        let rates = Rates {
            layers: rates.layers * factor,
            table: rates.table * factor,
        };
        training.step(&batch.points, rates, |output| {
            adjoint(output, &batch.targets, evidence)
        });
    }
    training.parameters
}

impl Batch {
    /// Half the samples near the surface, half anywhere in the unit ball.
    fn new(shape: &Prism, evidence: Evidence, rng: &mut impl Rng) -> Self {
        let (mut points, mut targets) = (Vec::new(), Vec::new());
        for i in 0..SAMPLES {
            let point = if i % 2 == 0 {
                let (surface, _) = surface_point(shape, rng);
                surface.map(|x| x + NEAR * standard_normal(rng))
            } else {
                in_unit_ball(rng)
            };
            let distance = shape.distance(point).0;
            points.extend(point.map(|x| x as f32));
            targets.push(match evidence {
                Evidence::Exact => distance as f32,
                Evidence::Observed => (distance + NOISE * standard_normal(rng)) as f32,
            });
        }
        Self { points, targets }
    }
}

/// A point in the unit ball.
pub fn in_unit_ball(rng: &mut impl Rng) -> Vector {
    loop {
        let point: Vector = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        if super::shape::dot(point, point) <= 1.0 {
            return point;
        }
    }
}

/// A point on the surface, the foot of one in the ball, and a normal there.
pub fn surface_point(shape: &Prism, rng: &mut impl Rng) -> (Vector, Vector) {
    let point = in_unit_ball(rng);
    let (distance, gradient) = shape.distance(point);
    let foot = std::array::from_fn(|i| point[i] - distance * gradient[i]);
    (foot, gradient)
}

/// Adjoint of `mean |f − target| + EIKONAL · mean (|∇f| − 1)²`.
fn adjoint(output: &Output, targets: &[f32], evidence: Evidence) -> Adjoint {
    let share = 1.0 / targets.len() as f32;
    let of_value = |(f, target): (&f32, &f32)| {
        let target = match evidence {
            Evidence::Exact => *target,
            Evidence::Observed => target.clamp(-BAND, BAND),
        };
        // Beyond the band every distance on the right side is right.
        let beyond = evidence == Evidence::Observed
            && (target >= BAND && *f >= BAND || target <= -BAND && *f <= -BAND);
        if beyond {
            0.0
        } else {
            share * (f - target).signum()
        }
    };
    let of_gradient = |g: &[f32; 3]| {
        let length = g.iter().map(|x| x * x).sum::<f32>().sqrt();
        let scale = 2.0 * EIKONAL * share * (length - 1.0) / length.max(1e-6);
        g.map(|x| scale * x)
    };
    Adjoint {
        first: output.first.iter().zip(targets).map(of_value).collect(),
        gradient: output.gradient.iter().map(of_gradient).collect(),
        others: vec![0.0; output.others.len()],
    }
}
