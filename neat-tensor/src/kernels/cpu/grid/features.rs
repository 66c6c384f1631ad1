//! Features of many points alone, for networks that take them as inputs, and their
//! backward pass.

use super::{GridAdjoint, GridShape, POINT};
use pulp::Arch;
use rayon::prelude::*;

/// Points of a task: enough to make handing it out cheap, few enough for every thread to
/// get some.
const TASK: usize = 256;

impl GridShape {
    /// The features `[N, width]` of `table` at `points` `[N, 3]`.
    pub fn features_at(&self, arch: Arch, points: &[f32], table: &[f32]) -> Vec<f32> {
        let width = self.width();
        let mut out = vec![0.0; points.len() / POINT * width];
        out.par_chunks_mut(TASK * width)
            .zip(points.par_chunks(TASK * POINT))
            .for_each(|(out, points)| self.encode(arch, points, table, out, width, 0, None));
        out
    }

    /// The gradient of `Σ features · adjoint` with respect to the table.
    pub fn features_to_table(&self, arch: Arch, points: &[f32], adjoint: &[f32]) -> Vec<f32> {
        let width = self.width();
        let mut of_features = vec![0.0; adjoint.len()];
        of_features
            .par_chunks_mut(TASK * width)
            .zip(adjoint.par_chunks(TASK * width))
            .for_each(|(out, adjoint)| {
                self.gather_adjoint(adjoint.len() / width, adjoint, None, width, 0, out);
            });
        let adjoints: Vec<GridAdjoint<'_>> = points
            .chunks(TASK * POINT)
            .zip(of_features.chunks(TASK * width))
            .map(|(points, of_features)| GridAdjoint {
                points,
                tangents: None,
                of_features,
            })
            .collect();
        self.scatter(arch, &adjoints)
    }

    /// The gradient of `Σ features · adjoint` with respect to the points.
    pub fn features_to_points(
        &self,
        arch: Arch,
        points: &[f32],
        table: &[f32],
        adjoint: &[f32],
    ) -> Vec<f32> {
        let width = self.width();
        let mut of_points = vec![0.0; points.len()];
        of_points
            .par_chunks_mut(TASK * POINT)
            .zip(points.par_chunks(TASK * POINT))
            .zip(adjoint.par_chunks(TASK * width))
            .for_each(|((out, points), adjoint)| {
                let mut features = vec![0.0; adjoint.len()];
                let mut jacobian = vec![0.0; POINT * adjoint.len()];
                let wanted = Some(&mut jacobian[..]);
                self.encode(arch, points, table, &mut features, width, 0, wanted);
                for (i, (out, slope)) in out.iter_mut().zip(jacobian.chunks(width)).enumerate() {
                    let adjoint = &adjoint[i / POINT * width..][..width];
                    *out = slope.iter().zip(adjoint).map(|(d, a)| d * a).sum();
                }
            });
        of_points
    }
}
