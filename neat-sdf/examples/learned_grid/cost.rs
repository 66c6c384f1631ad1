//! What a field costs per sample.

use super::candidates::{Candidate, OUTPUTS};
use super::field::Adjoint;
use super::fit::{SAMPLES, Training, in_unit_ball};
use neat_tensor::random::{Purpose, stream};
use std::time::Instant;

/// Rounds in which all fields take their turn; the fastest counts.
const ROUNDS: usize = 60;

/// Nanoseconds per sample.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Distance alone.
    pub distance: f64,
    /// Distance, gradient and features.
    pub forward: f64,
    /// Their backward pass.
    pub backward: f64,
    /// Forward, backward and optimiser.
    pub step: f64,
}

impl Cost {
    /// The optimiser's part of a step.
    pub fn adam(&self) -> f64 {
        self.step - self.forward - self.backward
    }

    fn min(self, other: Self) -> Self {
        Self {
            distance: self.distance.min(other.distance),
            forward: self.forward.min(other.forward),
            backward: self.backward.min(other.backward),
            step: self.step.min(other.step),
        }
    }
}

/// Costs of all `candidates`, in turns: what disturbs one disturbs all.
pub fn measure(candidates: &mut [Candidate]) -> Vec<Cost> {
    let mut rng = stream(0, Purpose::Samples, 0);
    let points: Vec<f32> = (0..SAMPLES)
        .flat_map(|_| in_unit_ball(&mut rng).map(|x| x as f32))
        .collect();
    let adjoint = || Adjoint {
        first: vec![1e-3; SAMPLES],
        gradient: vec![[1e-3; 3]; SAMPLES],
        others: vec![1e-3; SAMPLES * (OUTPUTS - 1)],
    };
    let mut best: Vec<Option<Cost>> = vec![None; candidates.len()];
    for _ in 0..ROUNDS {
        for (candidate, best) in candidates.iter_mut().zip(&mut best) {
            let rates = candidate.rates;
            let mut training = Training::new(&mut *candidate.field, 0);
            training.step(&points, rates, |_| adjoint());
            let step = time(|| training.step(&points, rates, |_| adjoint()));
            let parameters = training.parameters;
            let mut gradient = vec![0.0; parameters.len()];
            let field = &mut *candidate.field;
            let adjoint = adjoint();
            let cost = Cost {
                distance: time(|| _ = field.distances(&parameters, &points)),
                forward: time(|| _ = field.forward(&parameters, &points)),
                backward: time(|| field.backward(&parameters, &points, &adjoint, &mut gradient)),
                step,
            };
            *best = Some(best.map_or(cost, |best| best.min(cost)));
        }
    }
    best.into_iter().flatten().collect()
}

/// Nanoseconds per sample that `pass` takes.
fn time(pass: impl FnOnce()) -> f64 {
    let start = Instant::now();
    pass();
    start.elapsed().as_secs_f64() * 1e9 / SAMPLES as f64
}
