//! Domes: parts of spheres around the axis of a rim, which no edge shows but an outline in each view.
//!
//! What many edgels agree on (`touched_spheres.rs`) is fitted to the edgels beside its outlines. It ends
//! at a rim on the sphere, or touches the cylinder of a rim.

use super::arc_tubes::GAP_IN_PIXELS;
use super::circle_fitting::FoundArc;
use super::curve_samples::{SPACING, distance_of_curve};
use super::edge_samples::{Images, Sample};
use super::line_fitting::change_by_edgels;
use super::outlines::{ADVANTAGE, FOUND, MIN_EDGELS};
use super::touched_spheres::{AxisLine, Rim, TouchedSphere, agreed, most_voted};
use nalgebra::Vector2;
use neat_core::{CircularArc, Dome, LineSegment3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// A dome that images show.
#[derive(Clone, Debug)]
pub(super) struct FoundDome {
    pub dome: Dome,
    /// What outlines say for it, in nats.
    pub gain: f64,
    /// The size of a pixel.
    pub pixel: f64,
}

/// Circles around one axis.
struct Axis<'a> {
    line: AxisLine,
    arcs: Vec<&'a FoundArc>,
}

/// What is farther from a sphere, in pixels, is no outline of it, judged: as for chords of arcs.
const TOUCHING_IN_PIXELS: f64 = 8.0;

/// Arcs of less than half a circle say little about their axis.
const MIN_SWEEP: f64 = PI;

/// Before it is fitted to the edgels beside its outlines, a sphere ends at rims within so many times the gap.
const FIRST_GAPS: f64 = 4.0;

/// Reaches of the fits.
const FITTING_REACHES: [f64; 4] = [4.0, 2.5, 1.5, 1.0];
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-6;

/// Centre and radius are chosen as they want, and each view shows something somewhere.
const FREE_VIEWS: usize = 2;
/// A dome is worth as much as a tube has to be, the best of many tries, and this many nats more than another
/// surface that lies along parts of it, which is as wrong as 1 in 20. Of six true ones the least is worth 18,
/// a rounded edge −20.
const LEAST_OF_WHOLE: f64 = 3.0;

impl FoundDome {
    /// Whether a line lies along the sphere before the rim.
    pub(super) fn is_touched_by(&self, line: &LineSegment3) -> bool {
        let near = TOUCHING_IN_PIXELS * self.pixel;
        let is_beside = |place: &f64| {
            let offset = line.point_at(*place) - self.dome.center;
            (offset.norm() - self.dome.radius).abs() <= near
                && self.dome.axis.dot(&offset) >= self.dome.radius * self.dome.reach.cos() - near
        };
        [0.1, 0.5, 0.9].iter().all(is_beside)
    }
}

/// The domes around the axes of arcs. Arcs for which not more than `least` speaks where outlines of domes
/// have their edgels are left out.
pub(super) fn take_domes(images: &Images, arcs: &mut Vec<FoundArc>, least: f64) -> Vec<FoundDome> {
    let domes = find_domes(images, arcs);
    if !domes.is_empty() {
        let mut taken = images.nothing_taken();
        for found in &domes {
            images.claim_dome(found, &mut taken);
        }
        arcs.retain(|found| {
            let left = images.settle_arc(found, &taken);
            left.is_some_and(|left| left.gain > least)
        });
    }
    domes
}

/// The domes around the axes of arcs.
fn find_domes(images: &Images, arcs: &[FoundArc]) -> Vec<FoundDome> {
    let mut domes: Vec<FoundDome> = Vec::new();
    for axis in axes(arcs) {
        let spheres = images.spheres_on(&axis);
        let mut taken = images.nothing_taken();
        for arc in &axis.arcs {
            images.claim_arc(arc, &mut taken);
        }
        let by_rim = |rim: &&FoundArc| {
            let of_side = |side: usize| images.domes_by(&axis, rim, (side, &spheres[side]), &taken);
            [0, 1].map(of_side).concat()
        };
        let mut of_axis: Vec<FoundDome> = axis.arcs.par_iter().flat_map_iter(by_rim).collect();
        of_axis.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for found in of_axis {
            if !domes.iter().any(|other| is_same(&found, other)) {
                domes.push(found);
            }
        }
    }
    domes
}

/// The domes where arcs are that have been placed since: around the axis of the rim at which they end, or
/// as wide as the cylinder that they touch. Of a sphere outlines know the radius better than a small rim
/// on it.
pub(super) fn settled_domes(domes: &[FoundDome], arcs: &[FoundArc]) -> Vec<Dome> {
    let settled = |found: &FoundDome| {
        let (dome, gap) = (found.dome, GAP_IN_PIXELS * found.pixel);
        let line = AxisLine {
            origin: dome.center,
            direction: dome.axis,
        };
        let is_around = |found: &&FoundArc| {
            found.arc.sweep() > MIN_SWEEP && line.distance_to(&found.arc) <= gap
        };
        let around = arcs.iter().filter(is_around);
        let ends = around.filter_map(|rim| Some((rim, reach_at(&dome, &rim.arc, gap)?)));
        let nearest = ends.min_by(|(_, a), (_, b)| {
            let turned = |reach: &f64| (reach - dome.reach).abs();
            turned(a).total_cmp(&turned(b))
        });
        let (rim, reach) = nearest?;
        let axis = rim.arc.normal() * rim.arc.normal().dot(&dome.axis).signum();
        let along = axis.dot(&(dome.center - rim.arc.center));
        let is_touched = reach == FRAC_PI_2 && along.abs() > gap;
        let radius = if is_touched {
            rim.arc.radius
        } else {
            dome.radius
        };
        Some(Dome {
            center: rim.arc.center + along * axis,
            axis,
            radius,
            reach,
        })
    };
    domes.iter().filter_map(settled).collect()
}

fn is_same(one: &FoundDome, other: &FoundDome) -> bool {
    let apart = (one.dome.center - other.dome.center).norm();
    let differ = (one.dome.radius - other.dome.radius).abs();
    let toward = one.dome.axis.dot(&other.dome.axis);
    apart.max(differ) <= 2.0 * GAP_IN_PIXELS * one.pixel && toward > 0.0
}

/// Larger rims know their axis better.
fn axes(arcs: &[FoundArc]) -> Vec<Axis<'_>> {
    let mut whole: Vec<&FoundArc> = (arcs.iter())
        .filter(|found| found.arc.sweep() > MIN_SWEEP)
        .collect();
    whole.sort_by(|a, b| b.arc.length().total_cmp(&a.arc.length()));
    let mut axes: Vec<Axis> = Vec::new();
    for found in whole {
        let (arc, gap) = (&found.arc, GAP_IN_PIXELS * found.pixel);
        match (axes.iter_mut()).find(|axis| axis.line.distance_to(arc) <= gap) {
            Some(axis) => axis.arcs.push(found),
            None => axes.push(Axis {
                line: AxisLine {
                    origin: arc.center,
                    direction: arc.normal(),
                },
                arcs: vec![found],
            }),
        }
    }
    axes
}

impl Axis<'_> {
    fn rim(&self, found: &FoundArc) -> Rim {
        Rim {
            height: self
                .line
                .direction
                .dot(&(found.arc.center - self.line.origin)),
            radius: found.arc.radius,
        }
    }
}

impl Images<'_> {
    /// The spheres around points of an axis that edgels tell of, as far as they matter to a rim: those that
    /// are touched toward the axis' end, and those toward its start.
    fn spheres_on(&self, axis: &Axis) -> [Vec<TouchedSphere>; 2] {
        let rims: Vec<Rim> = axis.arcs.iter().map(|found| axis.rim(found)).collect();
        let views = self.views.par_iter().zip(self.maps);
        let in_view = views.flat_map_iter(|(view, map)| {
            let edgels = (0..map.len()).map(|edgel| map.get(edgel));
            let spheres =
                edgels.filter_map(|edgel| TouchedSphere::by(&axis.line, &view.camera, edgel));
            spheres.filter(|sphere| rims.iter().any(|rim| sphere.is_near(rim)))
        });
        let (ahead, behind) = in_view.partition(|sphere: &TouchedSphere| sphere.along > 0.0);
        [ahead, behind]
    }

    /// The domes about as large as a rim, on one of [both sides](Self::spheres_on).
    fn domes_by(
        &self,
        axis: &Axis,
        found: &FoundArc,
        (side, spheres): (usize, &[TouchedSphere]),
        taken: &[Vec<bool>],
    ) -> Vec<FoundDome> {
        let rim = axis.rim(found);
        let toward = [1.0, -1.0][side] * axis.line.direction;
        let settled = |voted: [f64; 2]| {
            let [height, radius] = agreed(voted, spheres, &rim, found.pixel)?;
            let sphere = Dome {
                center: axis.line.origin + height * axis.line.direction,
                axis: toward,
                radius,
                reach: FRAC_PI_2,
            };
            self.settled_dome(axis, &sphere, found.pixel, taken)
        };
        let voted = most_voted(&rim, spheres).into_iter();
        voted.filter_map(settled).collect()
    }

    /// The dome of a sphere, as far as its outlines say most for it.
    fn settled_dome(
        &self,
        axis: &Axis,
        sphere: &Dome,
        pixel: f64,
        taken: &[Vec<bool>],
    ) -> Option<FoundDome> {
        let gap = GAP_IN_PIXELS * pixel;
        let fitted = reaches(axis, sphere, FIRST_GAPS * gap)
            .into_iter()
            .filter_map(|reach| self.fit_dome(Dome { reach, ..*sphere }, pixel));
        let ended = fitted.flat_map(|fitted| {
            let reaches = reaches(axis, &fitted, gap).into_iter();
            reaches.map(move |reach| Dome { reach, ..fitted })
        });
        let found = ended.filter_map(|dome| {
            Some(FoundDome {
                dome,
                gain: self.gain_of_dome(&dome, taken)?,
                pixel,
            })
        });
        let best = found.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        (best.gain > ADVANTAGE).then_some(best)
    }

    fn outline_of(&self, dome: &Dome, view: usize) -> Option<CircularArc> {
        dome.outline_from(&self.views[view].camera.center_in_world)
    }

    /// The sphere through the edgels beside the outlines of a dome.
    fn fit_dome(&self, mut dome: Dome, pixel: f64) -> Option<Dome> {
        for reaches in FITTING_REACHES {
            let reach = reaches * self.reach;
            let rows: Vec<(Vector2<f64>, f64)> = (0..self.views.len())
                .into_par_iter()
                .flat_map_iter(|view| self.rows_of_dome(&dome, view, reach))
                .collect();
            let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
            dome.center += change[0] * dome.axis;
            dome.radius += change[1];
            if dome.radius <= 0.0 {
                return None;
            }
        }
        Some(dome)
    }

    /// How the distances of edgels from the outline in a view change with the centre's height and the
    /// radius, and what takes them away.
    fn rows_of_dome(&self, dome: &Dome, view: usize, reach: f64) -> Vec<(Vector2<f64>, f64)> {
        let camera = &self.views[view].camera;
        let Some(outline) = self.outline_of(dome, view) else {
            return Vec::new();
        };
        let samples = self.samples_of_sector(view, &outline, outline.angles, SPACING);
        let samples = samples.unwrap_or_default();
        let row = |sample: &Sample| {
            let edgel = self.edgel(view, sample, reach)?;
            let position = self.maps[view].get(edgel).position.cast();
            let point = outline.point_at(sample.place);
            let tangent = outline.radius * outline.tangent_at(sample.place);
            let (distance, by_point) = distance_of_curve(camera, &point, &tangent, &position)?;
            let normal = (point - dome.center) / dome.radius;
            let row = Vector2::new(by_point.dot(&dome.axis), by_point.dot(&normal));
            Some((row, -distance))
        };
        let rows: Vec<_> = samples.iter().filter_map(row).collect();
        if (rows.len() as f64) < FOUND * samples.len() as f64 {
            return Vec::new();
        }
        rows
    }

    /// What its outlines say for a dome; `None` where they say as much for another surface beside it.
    fn gain_of_dome(&self, dome: &Dome, taken: &[Vec<bool>]) -> Option<f64> {
        let pole = dome.center + dome.radius * dome.axis;
        let in_view = |view: usize| {
            let outline = self.outline_of(dome, view)?;
            self.samples_of_sector(view, &outline, outline.angles, SPACING)
        };
        let found =
            self.evidence_of_samples(&pole, in_view, Some(taken), f64::NEG_INFINITY, FREE_VIEWS);
        (found.gain_of_whole() > LEAST_OF_WHOLE).then_some(found.gain)
    }

    /// Takes the edgels of the outlines of a dome, in all views.
    pub(super) fn claim_dome(&self, found: &FoundDome, taken: &mut [Vec<bool>]) {
        let in_view = |view: usize| self.outline_of(&found.dome, view);
        self.claim_arc_of(found.pixel, in_view, taken);
    }
}

/// Where a dome of a sphere may end: at the rims on it, and where it touches the cylinders of rims.
fn reaches(axis: &Axis, dome: &Dome, gap: f64) -> Vec<f64> {
    let rims = axis.arcs.iter();
    rims.filter_map(|rim| reach_at(dome, &rim.arc, gap))
        .collect()
}

/// The angle of its rim if a dome ends at a circle around its axis, or touches the cylinder of this circle.
fn reach_at(dome: &Dome, circle: &CircularArc, gap: f64) -> Option<f64> {
    let radius = circle.radius;
    let ahead = dome.axis.dot(&(circle.center - dome.center));
    let is_on_sphere = (radius.hypot(ahead) - dome.radius).abs() <= gap;
    let is_touched = (radius - dome.radius).abs() <= gap && ahead < -gap;
    let on_sphere = is_on_sphere.then(|| radius.atan2(ahead));
    on_sphere.or(is_touched.then_some(FRAC_PI_2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::circle_fitting::tests::found;
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use nalgebra::Vector3;
    use neat_core::Camera;
    use std::f64::consts::TAU;

    const RADIUS: f64 = 0.3;

    fn rim(radius: f64, height: f64) -> CircularArc {
        CircularArc {
            center: Vector3::z() * height,
            axes: [Vector3::x(), Vector3::y()],
            radius,
            angles: [0.0, TAU],
        }
    }

    /// Views of a rim and of the outlines of a dome that is pressed flat along its axis.
    fn views_of(rim: &CircularArc, dome: &Dome, flattened: f64) -> TestViews {
        let view = |camera: &Camera| {
            let pressed =
                |point: &Vector3<f64>, by: f64| Vector3::new(point.x, point.y, by * point.z);
            let eye = pressed(&camera.center_in_world, flattened.recip());
            let outline = dome.outline_from(&eye);
            let of_dome = outline.map(|outline| outline.points(0.02));
            let of_dome = of_dome.unwrap_or_default();
            let of_dome: Vec<Vector3<f64>> = of_dome
                .iter()
                .map(|point| pressed(point, flattened))
                .collect();
            let mut points = rim.points(0.02);
            let first = points.len();
            points.extend(of_dome);
            let edges = (1..points.len())
                .filter(|k| *k != first)
                .map(|k| [k - 1, k]);
            let edges: Vec<[usize; 2]> = edges.collect();
            let seen = views_of_edges(&[*camera], &points, &edges);
            PreparedView::new(&seen[0], 1.0, 0.0)
        };
        TestViews::of(cameras_on_sphere(40).iter().map(view).collect())
    }

    /// Around the origin.
    fn dome(reach: f64) -> Dome {
        Dome {
            center: Vector3::zeros(),
            axis: Vector3::z(),
            radius: RADIUS,
            reach,
        }
    }

    #[test]
    fn outlines_tell_where_a_dome_is_and_where_it_ends() {
        // The end of a pin, a lens and a ball on a stem.
        for (height, reach) in [(-0.25, FRAC_PI_2), (0.22, 0.747), (-0.2, 2.301)] {
            let truth = dome(reach);
            let radius = if reach == FRAC_PI_2 {
                RADIUS
            } else {
                RADIUS * reach.sin()
            };
            let base = rim(radius, height);
            let views = views_of(&base, &truth, 1.0);
            let images = views.images();
            // What its outlines explain is no arc.
            let eyes = images.views.iter().map(|view| view.camera.center_in_world);
            let mut outlines = eyes.filter_map(|eye| truth.outline_from(&eye));
            let outline = outlines.next().unwrap();
            // Its ends lie along the rim, and of a lens the rest is near it, too.
            let middle = CircularArc {
                angles: outline.angles.map(|angle| 0.5 * angle),
                ..outline
            };
            let mut arcs = vec![found(middle), found(base)];
            let domes = take_domes(&images, &mut arcs, 5.0);
            assert_eq!(domes.len(), 1, "{reach} {domes:?}");
            assert_eq!(arcs.len(), 1);
            assert_eq!(arcs[0].arc, base);
            let [settled] = settled_domes(&domes, &arcs)[..] else {
                panic!("{reach}");
            };
            assert!(settled.center.norm() < 2e-3, "{reach} {settled:?}");
            assert!((settled.radius - RADIUS).abs() < 2e-3 && settled.axis.z > 0.999);
            assert!((settled.reach - reach).abs() < 0.02, "{reach} {settled:?}");
        }
    }

    #[test]
    fn what_is_no_sphere_is_no_dome() {
        let base = rim(RADIUS, -0.25);
        for flattened in [0.6, 0.8] {
            let views = views_of(&base, &dome(FRAC_PI_2), flattened);
            let domes = find_domes(&views.images(), &[found(base)]);
            assert!(domes.is_empty(), "{flattened} {domes:?}");
        }
        // A lid, of which only the rim is seen.
        let views = views_of(&base, &dome(1e-3), 1.0);
        assert!(find_domes(&views.images(), &[found(base)]).is_empty());
    }
}
