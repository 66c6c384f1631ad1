//! Arcs where profiles place them.

use super::bundle::Bundle;
use super::circular::Circular;
use crate::assemble::circle_fitting::FoundArc;
use nalgebra::Matrix4;
use neat_core::CircularArc;

/// What profiles tell of an arc: where it is, with the covariance of its centre and radius.
pub(super) struct PlacedArc(Option<(CircularArc, Option<Matrix4<f64>>)>);

impl PlacedArc {
    pub(super) fn new(circular: &Circular, bundle: &Bundle<'_, 6>) -> Self {
        let moved = bundle.own.and_then(|step| circular.moved(&step));
        Self(moved.map(|arc| {
            let covariance = bundle.covariance();
            let of_arc = covariance.map(|covariance| circular.covariance(&covariance));
            (arc, of_arc)
        }))
    }
}

/// Moves arcs to where they are. How many arcs have moved.
pub(super) fn move_arcs(arcs: &mut [FoundArc], placed: Vec<Option<PlacedArc>>) -> usize {
    let mut moved = 0;
    for (found, placed) in arcs.iter_mut().zip(placed) {
        if let Some(PlacedArc(Some((arc, covariance)))) = placed {
            (found.arc, found.covariance) = (arc, covariance);
            moved += 1;
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use crate::assemble::profiles::tests::cameras;
    use crate::assemble::profiles::{Photographs, place_curves};
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::views_of_edges;
    use image::{Rgb, RgbImage};
    use nalgebra::{Vector2, Vector3};
    use neat_core::{Camera, CircularArc};
    use std::borrow::Cow;
    use std::f64::consts::TAU;
    use std::ops::ControlFlow;

    /// A dark disc on light ground, in the plane z = 0: each pixel is a root of the light that falls
    /// on it.
    fn photograph_of_disc(camera: &Camera, disc: &CircularArc, exponent: f64) -> RgbImage {
        const GRID: u32 = 8;
        RgbImage::from_fn(camera.width, camera.height, |x, y| {
            let mut light = 0.0;
            for k in 0..GRID * GRID {
                let part = Vector2::new(f64::from(k % GRID), f64::from(k / GRID)).add_scalar(0.5);
                let pixel = Vector2::new(f64::from(x), f64::from(y)) + part / f64::from(GRID);
                let ray = camera.ray_through(&pixel);
                let point = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
                let dark = (point - disc.center).norm() < disc.radius;
                light += if dark { 0.05 } else { 0.8 } / f64::from(GRID * GRID);
            }
            Rgb([(255.0 * f64::powf(light, exponent.recip())).round() as u8; 3])
        })
    }

    #[test]
    fn an_arc_beside_the_rim_of_a_disc_comes_to_lie_on_it() {
        let cameras = cameras();
        let truth = CircularArc {
            center: Vector3::new(0.03, -0.02, 0.0),
            axes: [Vector3::x(), Vector3::y()],
            radius: 0.25,
            angles: [0.0, TAU],
        };
        // What edgels say: smaller by a third of a pixel.
        let pixel = 0.0036;
        let seen = CircularArc {
            radius: truth.radius - 0.3 * pixel,
            ..truth
        };
        let points = seen.points(TAU / 120.0);
        let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
        let observations = views_of_edges(&cameras, &points, &edges);
        let prepared = observations
            .iter()
            .map(|view| PreparedView::new(view, 1.0, 0.0));
        let views = TestViews::of(prepared.collect());
        let images = views.images();
        let part = CircularArc {
            angles: [0.0, 1.5],
            ..seen
        };
        let all: Vec<usize> = (0..cameras.len()).collect();
        let found = images.follow_arc(&part, &all).unwrap();
        let found = images.settle_arc(&found, &images.nothing_taken()).unwrap();
        for exponent in [1.0, 2.4] {
            let photographs: Vec<RgbImage> = (cameras.iter())
                .map(|camera| photograph_of_disc(camera, &truth, exponent))
                .collect();
            let photographs = Photographs {
                image_of: &|view| Some(Cow::Borrowed(&photographs[view])),
                pixel_center: 0.5,
            };
            let mut arcs = [found.clone()];
            let go_on = &mut |_| ControlFlow::Continue(());
            let placed = place_curves(&images, photographs, &mut Vec::new(), &mut arcs, go_on);
            assert!(placed.is_continue());
            // Between pixels values are not quite a root of light: with sides of which one is
            // sixteen times as bright as the other that is a few hundredths.
            let most = if exponent > 1.0 { 0.06 } else { 0.02 };
            let arc = &arcs[0].arc;
            let off = [
                arc.radius - truth.radius,
                (arc.center - truth.center).norm(),
            ];
            let off = off.map(|off| off.abs() / pixel);
            assert!(off.iter().all(|off| *off < most), "{exponent}: {off:?}");
            let sigma = arcs[0].covariance.unwrap()[(3, 3)].sqrt() / pixel;
            assert!((0.005..0.05).contains(&sigma), "{exponent}: {sigma}");
        }
    }
}
