//! Samples drawn once more, by the network's distances at the first ones.
//!
//! A grid tells where a surface is to a cell. The network's distances at the samples drawn by
//! it, taken as linear in between, tell it to a fraction of the density's scale: one round of
//! what VolSDF's Algorithm 1 repeats until its bound holds.

use super::RaySamples;
use super::ray_sections::RaySections;
use rayon::prelude::*;

/// A section between two samples is cut into so many, each with the density of its middle.
const PARTS: usize = 8;

/// How samples are drawn along every ray.
pub(super) struct Redraw<'a> {
    /// The first samples.
    pub first: &'a RaySamples,
    /// Capped distances at them.
    pub sdf: &'a [f32],
    /// Scale of the density.
    pub beta: f32,
    /// Added to every part's weight.
    pub weight_floor: f32,
    /// Samples to be drawn; the others are spread evenly.
    pub drawn: usize,
}

impl Redraw<'_> {
    /// As many samples as the first. `chord` says where a ray enters and leaves what is
    /// sampled, `jitter(ray, i)` in [0, 1) where in its stratum sample `i` lies.
    pub fn samples(
        &self,
        chord: impl Fn(usize) -> (f32, f32) + Sync,
        jitter: impl Fn(usize, usize) -> f32 + Sync,
    ) -> RaySamples {
        let per_ray = self.first.per_ray;
        let mut z = vec![0.0f32; self.first.z.len()];
        (z.par_chunks_mut(per_ray).enumerate()).for_each_init(
            RaySections::default,
            |sections, (ray, z)| {
                self.cut(sections, ray, chord(ray));
                sections.weigh(self.beta, self.weight_floor);
                sections.draw(z, self.drawn, chord(ray), |i| jitter(ray, i));
            },
        );
        RaySamples::new(z, per_ray, |ray, last| (chord(ray).1 - last).max(0.0))
    }

    /// Cuts ray `ray` into parts.
    fn cut(&self, sections: &mut RaySections, ray: usize, (near, far): (f32, f32)) {
        let per_ray = self.first.per_ray;
        let of_ray = ray * per_ray..(ray + 1) * per_ray;
        let (z, sdf) = (&self.first.z[of_ray.clone()], &self.sdf[of_ray]);
        sections.edges.clear();
        sections.sdf.clear();
        let (first, last) = ((near, sdf[0]), (far, sdf[per_ray - 1]));
        let mut from = first;
        for to in z.iter().copied().zip(sdf.iter().copied()).chain([last]) {
            for part in 0..PARTS {
                let at = |t: f32, a: f32, b: f32| a + (b - a) * t / PARTS as f32;
                sections.edges.push(at(part as f32, from.0, to.0));
                sections.sdf.push(at(part as f32 + 0.5, from.1, to.1));
            }
            from = to;
        }
        sections.edges.push(far);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One ray from 0 to 2 through a wall that begins at `wall`, first sampled every fifth.
    fn redrawn(wall: f32, beta: f32, drawn: usize) -> Vec<f32> {
        let z: Vec<f32> = (0..10).map(|i| 0.1 + 0.2 * i as f32).collect();
        let sdf: Vec<f32> = z.iter().map(|z| wall - z).collect();
        let redraw = Redraw {
            first: &RaySamples::new(z, 10, |_, last| 2.0 - last),
            sdf: &sdf,
            beta,
            weight_floor: 0.0,
            drawn,
        };
        let samples = redraw.samples(|_| (0.0, 2.0), |_, _| 0.5);
        assert!(samples.z.is_sorted(), "{:?}", samples.z);
        let end = samples.z[9] + samples.deltas[9];
        assert!((end - 2.0).abs() < 1e-6, "{end}");
        samples.z
    }

    #[test]
    fn samples_gather_within_a_part_of_the_surface() {
        let part = 0.2 / PARTS as f32;
        for wall in [0.63, 1.17] {
            for z in redrawn(wall, 0.001, 10) {
                // In the part whose middle is the first behind the surface, or the one before.
                assert!((z - wall).abs() < 1.5 * part, "{z} for {wall}");
            }
        }
    }

    #[test]
    fn samples_follow_the_weights_of_a_wide_density() {
        // A density of 1/β at a depth of several β: the median weight lies near ln 2 · β.
        let z = redrawn(0.5, 0.1, 10);
        let behind = z.iter().filter(|z| **z > 0.5).count();
        assert!((3..=8).contains(&behind), "{z:?}");
        assert!(z.iter().all(|z| (z - 0.5).abs() < 0.5), "{z:?}");
    }

    #[test]
    fn the_others_are_spread_evenly() {
        let z = redrawn(0.63, 0.001, 6);
        for even in [0.25, 0.75, 1.25, 1.75] {
            assert!(z.iter().any(|z| (z - even).abs() < 1e-6), "{z:?}");
        }
    }
}
