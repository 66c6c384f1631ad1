//! Whether the light changes across a piece of a few pixels.
//!
//! Smoothing rounds the edgels of such pieces and fills gaps between edges with them. Images are
//! sharper: between ends that are known, the light of a view in the middle of a piece has a step, or
//! has none.

use super::Photographs;
use super::light::{LightProfile, Response};
use super::pixels::Pixels;
use super::profile::{PLACES, Profile, REACH, places};
use super::step_model::{misfit, misfit_at};
use crate::assemble::edge_samples::Images;
use crate::projection::project_in_front;
use nalgebra::{SVector, Vector2};
use neat_core::{Camera, LineSegment3};
use rayon::prelude::*;

/// Light is asked for so far beside a piece, in pixels: farther off are the edges of a slit.
const SIDE: f64 = 3.0;
/// In its middle, this share of it: at its ends other edges begin.
const MIDDLE: f64 = 0.4;
/// Places along it.
const SAMPLES: usize = 5;
/// A shorter projection has no middle, in pixels.
const MIN_LENGTH: f64 = 2.5;
/// A step may lie so far beside the piece to both sides, in pixels.
const ASIDE: [f64; 5] = [-0.5, -0.25, 0.0, 0.25, 0.5];
/// A view shows a step that explains this share of what is there, judged …
const EXPLAINED: f64 = 0.85;
/// … and none where less is there than this, by usual noise: about a value at each place.
const FLAT: f64 = 0.08;
/// What a view says that shows a step, and one that does not, in nats: judged by those that hold a
/// true edge of four pixels of `part-004`, of which 41 % show a step, and those that hold another pair
/// of its corners, of which 9 % do.
const STEP: f64 = 1.6;
const NO_STEP: f64 = -0.7;

/// A piece, and the views that are asked for it.
pub(in crate::assemble) struct Asked {
    pub piece: LineSegment3,
    /// Ascending.
    pub views: Vec<usize>,
}

/// In how many views the light has a step across a piece, in how many it has none, and in how many
/// there is something else.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::assemble) struct Light {
    pub step: usize,
    pub flat: usize,
    pub other: usize,
}

/// What the views show across pieces.
pub(in crate::assemble) fn light_across(
    images: &Images,
    photographs: Photographs<'_>,
    response: Response,
    asked: &[Asked],
) -> Vec<Light> {
    let mut lights = vec![Light::default(); asked.len()];
    for (view, prepared) in images.views.iter().enumerate() {
        let is_asked = |asked: &Asked| asked.views.binary_search(&view).is_ok();
        if !asked.iter().any(is_asked) {
            continue;
        }
        let camera = &prepared.camera;
        let Some(image) = (photographs.image_of)(view)
            .filter(|image| image.dimensions() == (camera.width, camera.height))
        else {
            continue;
        };
        let pixels = Pixels {
            image: &image,
            pixel_center: photographs.pixel_center,
        };
        (asked.par_iter().zip(&mut lights))
            .filter(|(asked, _)| is_asked(asked))
            .for_each(|(asked, light)| {
                if let Some(profile) = across(&asked.piece, view, camera, &pixels) {
                    light.add(&profile, response);
                }
            });
    }
    lights
}

/// What a view shows across the middle of a piece.
fn across(
    piece: &LineSegment3,
    view: usize,
    camera: &Camera,
    pixels: &Pixels<'_>,
) -> Option<Profile<4>> {
    let [start, end] = [
        project_in_front(camera, &piece.start)?,
        project_in_front(camera, &piece.end)?,
    ];
    let offset = end - start;
    if offset.norm() < MIN_LENGTH {
        return None;
    }
    let normal = Vector2::new(-offset.y, offset.x).normalize();
    let at = |k: usize| {
        let place = 0.5 + MIDDLE * (k as f64 / (SAMPLES - 1) as f64 - 0.5);
        (start + offset * place, normal)
    };
    let rays: [_; SAMPLES] = std::array::from_fn(at);
    let is_held =
        |side: f64| (rays.iter()).all(|(pixel, unit)| pixels.holds(&(pixel + unit * side)));
    (is_held(-REACH) && is_held(REACH)).then(|| Profile {
        view,
        along: 0.0,
        by_shift: normal,
        by_step: SVector::zeros(),
        values: pixels.medians(&rays),
    })
}

impl Light {
    /// Adds a view.
    fn add(&mut self, profile: &Profile<4>, response: Response) {
        let mut light = LightProfile::new(profile, response.exponent);
        let places: [f64; PLACES] = places();
        for (weight, place) in light.weights.iter_mut().zip(places) {
            if place.abs() > SIDE {
                *weight = 0.0;
            }
        }
        let there = misfit(&light, &[], response.blur);
        let left = (ASIDE.iter())
            .map(|place| misfit_at(&light, *place, response.blur))
            .fold(f64::INFINITY, f64::min);
        if there < FLAT {
            self.flat += 1;
        } else if left < (1.0 - EXPLAINED) * there {
            self.step += 1;
        } else {
            self.other += 1;
        }
    }

    /// How much likelier this is with an edge there than without, in nats.
    pub(in crate::assemble) fn for_edge(&self) -> f64 {
        STEP * self.step as f64 + NO_STEP * (self.flat + self.other) as f64
    }

    /// Likewise where other things in front of it are all that could hide an edge: only a view
    /// that shows none speaks against it.
    pub(in crate::assemble) fn for_rest_of_edge(&self) -> f64 {
        STEP * self.step as f64 + NO_STEP * self.flat as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::profiles::tests::{cameras, photograph};
    use crate::assemble::test_views::TestViews;
    use nalgebra::Vector3;
    use std::borrow::Cow;

    #[test]
    fn light_tells_pieces_of_four_pixels_from_gaps() {
        let cameras = cameras();
        let views = TestViews::of_edges(&cameras, &[Vector3::zeros(), Vector3::y()], &[[0, 1]]);
        let photographs = Photographs {
            image_of: &|view| Some(Cow::Owned(photograph(&cameras[view]))),
            pixel_center: 0.5,
        };
        let response = Response {
            exponent: 2.4,
            blur: 0.4,
        };
        // On an edge of a bar, on the bar, beside it; 0.015 are four pixels.
        let asked = [-0.3, -0.25, 0.0].map(|x| Asked {
            piece: LineSegment3::new(Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.015, 0.0)),
            views: (0..cameras.len()).collect(),
        });
        let lights = light_across(&views.images(), photographs, response, &asked);
        let gains = lights
            .iter()
            .map(|light| light.for_edge())
            .collect::<Vec<f64>>();
        assert!(gains[0] > 12.0, "{lights:?}");
        assert!(gains[1] < -4.0 && gains[2] < -4.0, "{lights:?}");
        assert!(lights[1].for_rest_of_edge() < -4.0, "{lights:?}");
        let asked = asked.map(|asked| Asked {
            views: Vec::new(),
            ..asked
        });
        let unseen = light_across(&views.images(), photographs, response, &asked);
        assert_eq!(unseen, [Light::default(); 3]);
    }
}
