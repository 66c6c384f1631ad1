//! Edges stay where they are from view to view; the shading of a round corner wanders over it.

use super::circle_fitting::{FoundArc, Sector};
use super::curve_samples::SPACING;
use super::edge_samples::Images;
use crate::statistics::upper_median;
use nalgebra::Vector2;
use rayon::prelude::*;

/// Fewer views of a part of an arc do not tell.
const MIN_VIEWS: usize = 3;
/// Farther than so often what the steadiest arc does, an arc wanders. Those of the parts'
/// fillets and torus do by .14 to .5 px, true ones of parts and photographs by .02 to .1.
const WANDERS: f64 = 3.0;
/// No edge is steadier, in pixels, as gradients are sampled: chance makes some arcs look so.
const STEADY: f64 = 0.05;

/// Leaves out the arcs that wander.
pub(super) fn retain_steady(images: &Images, arcs: &mut Vec<FoundArc>) {
    let wander: Vec<Option<f64>> = arcs.par_iter().map(|arc| images.wander_of(arc)).collect();
    let most = most_of_edges(&wander);
    let mut wander = wander.into_iter();
    arcs.retain(|_| wander.next().flatten().is_none_or(|wander| wander <= most));
}

/// Where poses are off, the steadiest arc wanders with them.
fn most_of_edges(wander: &[Option<f64>]) -> f64 {
    let known = wander.iter().flatten().copied();
    WANDERS * known.fold(f64::INFINITY, f64::min).max(STEADY)
}

impl Images<'_> {
    /// By how much, in pixels, an arc's edgels lie to different sides of it in different views:
    /// half the range of the middle half of the views, for the median part of the arc.
    fn wander_of(&self, found: &FoundArc) -> Option<f64> {
        let sectors = self.speaking_sectors(&found.arc, found.pixel, 0.0, None)?;
        let of_sector = |sector: &Sector| {
            let offset = |view| {
                let samples = self.samples_of_sector(view, &found.arc, sector.angles, SPACING)?;
                let mut offsets: Vec<f64> = (samples.iter())
                    .filter_map(|sample| {
                        let edgel = self.edgel(view, sample, self.reach)?;
                        let position: Vector2<f64> = self.maps[view].get(edgel).position.cast();
                        Some((position - sample.pixel).dot(&sample.normal))
                    })
                    .collect();
                (!offsets.is_empty()).then(|| upper_median(&mut offsets))
            };
            let mut offsets: Vec<f64> = sector.evidence.views().filter_map(offset).collect();
            offsets.sort_by(f64::total_cmp);
            let [low, high] = [1, 3].map(|quarter| offsets.len() * quarter / 4);
            (offsets.len() >= MIN_VIEWS).then(|| 0.5 * (offsets[high] - offsets[low]))
        };
        let mut of_sectors: Vec<f64> = sectors.iter().filter_map(of_sector).collect();
        (!of_sectors.is_empty()).then(|| upper_median(&mut of_sectors))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::{arc, views_of_arcs};
    use std::f64::consts::TAU;

    #[test]
    fn what_moves_from_view_to_view_is_left_out() {
        let found_in = |images: &Images| {
            let all: Vec<usize> = (0..images.views.len()).collect();
            let found = images.follow_arc(&arc(1.5), &all).unwrap();
            images.settle_arc(&found, &images.nothing_taken()).unwrap()
        };
        let still = views_of_arcs(40, |_| arc(TAU));
        let pixel = still.images().views[0].pixel_size_at(&arc(TAU).center);
        // Toward the camera's side, by less than edgels of an arc may be off.
        let moving = views_of_arcs(40, |camera| {
            let toward = camera.center_in_world.normalize();
            let mut moved = arc(TAU);
            moved.center += 2.0 * pixel * toward.dot(&moved.normal()) * moved.normal();
            moved
        });
        let (still, moving) = (still.images(), moving.images());
        let (steady, wandering) = (found_in(&still), found_in(&moving));
        assert!(still.wander_of(&steady).unwrap() < STEADY);
        assert!(moving.wander_of(&wandering).unwrap() > WANDERS * STEADY);
        assert!(most_of_edges(&[None, Some(0.02), Some(0.2)]) < 0.2);
        assert!(most_of_edges(&[None, Some(0.2), Some(0.5)]) > 0.5);
    }
}
