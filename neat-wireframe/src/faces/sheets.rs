//! Faces on known planes: the junctions that lie in a plane, triangulated with the edges between
//! them, and of the triangles those of which points say that they are surface.

use super::curves::Curves;
use super::explained_planes::explained_planes;
use super::face::{Face, Surface};
use super::groups::groups;
use super::min_cut::chosen;
use super::plane_fit::{CHI_SQUARE, FittedPlane, PlaneFit};
use super::plane_mesh::PlaneMesh;
use super::point_evidence::{
    Densities, PointEvidence, Sign, Witness, for_each_sign, log_ratio_of_sight,
};
use super::region::Region;
use super::selection::{MISSING_FACE, MOST_AGAINST};
use nalgebra::Vector3;
use neat_core::Camera;
use std::collections::{BTreeMap, BTreeSet};

/// What hides what is asked so often: the first time nothing hides anything yet.
const ROUNDS: usize = 3;
/// As everything here is told by two views at least, what fewer can see is not known.
const VIEWS: usize = 2;

/// A plane with its triangles.
struct Sheet<'a> {
    plane: FittedPlane<'a>,
    mesh: PlaneMesh,
}

/// Of the triangles of a plane, what points say.
struct Told {
    of_triangles: BTreeMap<usize, PointEvidence>,
    /// Points beside the plane over or under a triangle.
    beside: usize,
}

/// A face with its extent.
pub(super) type Placed = (Face, Region);

/// What views can see of places.
struct Sight<'a> {
    cameras: &'a [Camera],
    /// What lies nearer to a surface is on it.
    margin: f64,
}

impl Sight<'_> {
    /// Whether enough cameras see a place, with what hides it.
    fn reaches<'r>(
        &self,
        place: &Vector3<f64>,
        hiding: impl Iterator<Item = &'r Region> + Clone,
    ) -> bool {
        let sees = |camera: &&Camera| self.sees(camera, place, hiding.clone());
        self.cameras.iter().filter(sees).take(VIEWS).count() == VIEWS
    }

    /// Whether on one side of a face most cameras see a place of it, and enough do.
    fn reaches_most<'r>(
        &self,
        place: &Vector3<f64>,
        face: &Region,
        hiding: impl Iterator<Item = &'r Region> + Clone,
    ) -> bool {
        let Region::Plane { frame, .. } = face else {
            return true;
        };
        let toward = (self.cameras.iter()).filter(|camera| camera.sees(place));
        let (above, below): (Vec<&Camera>, Vec<&Camera>) =
            toward.partition(|camera| frame.normal.dot(&camera.center_in_world) > frame.offset);
        [above, below].iter().any(|cameras| {
            let sees = |camera: &&&Camera| self.sees(camera, place, hiding.clone());
            let count = cameras.iter().filter(sees).count();
            count >= VIEWS && 2 * count >= cameras.len()
        })
    }

    fn sees<'r>(
        &self,
        camera: &Camera,
        place: &Vector3<f64>,
        hiding: impl Iterator<Item = &'r Region>,
    ) -> bool {
        let center = &camera.center_in_world;
        let hides = |region: &Region| {
            region.distance_to_surface(place) > self.margin && region.is_between(center, place)
        };
        let mut hiding = hiding;
        camera.sees(place) && !hiding.any(hides)
    }
}

/// Faces on the planes of a scene, beside the `solid` ones that are known. Of the `open` ones those
/// are left out of which most is hidden from most cameras, or through which points are seen.
pub(super) fn sheets(
    curves: &Curves,
    solid: &[Region],
    open: &mut Vec<Placed>,
    cameras: &[Camera],
    witnesses: &mut [Witness],
) -> Vec<Face> {
    let measured: Vec<_> = witnesses.iter().map(|witness| witness.measured).collect();
    let planes = explained_planes(curves, &measured);
    let solved = planes.iter().filter_map(PlaneFit::solved);
    let sheets: Vec<Sheet> = solved
        .filter_map(|plane| {
            let mesh = PlaneMesh::new(curves, &plane)?;
            Some(Sheet { plane, mesh })
        })
        .collect();
    let margin = (CHI_SQUARE * curves.junction_floor()[0]).sqrt();
    let sight = Sight { cameras, margin };
    open.retain(|(_, region)| log_ratio_of_sight(region, witnesses, margin) >= -MOST_AGAINST);
    let mut placed: Vec<Vec<Placed>> = sheets.iter().map(|_| Vec::new()).collect();
    for round in 0..ROUNDS {
        witnesses
            .iter_mut()
            .for_each(|witness| witness.taken = false);
        for (place, sheet) in sheets.iter().enumerate() {
            let others = || {
                let others = (placed.iter().enumerate()).filter(|(other, _)| *other != place);
                let of_others = others.flat_map(|(_, faces)| faces);
                of_others.map(|(_, region)| region).chain(solid)
            };
            let known = || solid.iter().chain(open.iter().map(|(_, region)| region));
            let may_be = |place: &Vector3<f64>| {
                known().all(|region| !region.is_near(place, margin))
                    && (round == 0 || sight.reaches(place, others()))
            };
            placed[place] = sheet.faces(may_be, witnesses);
        }
        open.retain(|(_, region)| {
            let points = region.points();
            let hiding = || (placed.iter().flatten().map(|(_, region)| region)).chain(solid);
            let seen = (points.iter()).filter(|place| sight.reaches_most(place, region, hiding()));
            2 * seen.count() >= points.len()
        });
    }
    placed.into_iter().flatten().map(|(face, _)| face).collect()
}

impl Sheet<'_> {
    fn told(&self, witnesses: &[Witness]) -> Told {
        let Self { plane, mesh } = self;
        let with_area = |area| PointEvidence {
            area,
            ..PointEvidence::default()
        };
        let mut of_triangles: BTreeMap<usize, PointEvidence> = (mesh.triangles())
            .map(|(triangle, area, _)| (triangle, with_area(area)))
            .collect();
        let mut beside = 0;
        for witness in witnesses {
            let mut through = BTreeSet::new();
            for_each_sign(witness, plane, |place, sign| {
                let Some(triangle) = mesh.triangle_at(&place) else {
                    return;
                };
                match sign {
                    Sign::On => of_triangles.entry(triangle).or_default().on += 1,
                    Sign::Beside => beside += 1,
                    Sign::Through => {
                        through.insert(triangle);
                    }
                }
            });
            for triangle in through {
                of_triangles.entry(triangle).or_default().through += 1;
            }
        }
        Told {
            of_triangles,
            beside,
        }
    }

    fn faces(
        &self,
        may_be: impl Fn(&Vector3<f64>) -> bool,
        witnesses: &mut [Witness],
    ) -> Vec<Placed> {
        let told = self.told(witnesses);
        let Some(densities) = Densities::of(told.of_triangles.values(), told.beside) else {
            return Vec::new();
        };
        let possible = (self.mesh.triangles()).filter(|(_, _, centroid)| may_be(centroid));
        let mut gains: BTreeMap<usize, f64> = possible
            .map(|(triangle, _, _)| (triangle, told.of_triangles[&triangle].log_ratio(&densities)))
            .collect();
        let mut costs = BTreeMap::new();
        let mut joined: Vec<Vec<usize>> = Vec::new();
        let sides = self.mesh.sides();
        for (pair, is_edge) in &sides {
            let cost = if *is_edge { 0.0 } else { MISSING_FACE };
            let [a, b] = pair.map(|triangle| gains.contains_key(&triangle));
            match (a, b) {
                (true, true) => {
                    costs.insert(*pair, cost);
                }
                (true, false) | (false, true) => {
                    let inner = if a { pair[0] } else { pair[1] };
                    *gains.entry(inner).or_default() -= cost;
                }
                (false, false) => {}
            }
        }
        let kept = chosen(&gains, &costs);
        for (pair, _) in &sides {
            if pair.iter().all(|triangle| kept.contains(triangle)) {
                joined.push(pair.to_vec());
            }
        }
        joined.extend(kept.iter().map(|triangle| vec![*triangle]));
        for witness in witnesses {
            let mut taken = false;
            for_each_sign(witness, &self.plane, |place, sign| {
                let triangle = self.mesh.triangle_at(&place);
                taken |= sign == Sign::On && triangle.is_some_and(|t| kept.contains(&t));
            });
            witness.taken |= taken;
        }
        let (normal, offset) = self.plane.plane();
        let face = |triangles: &Vec<usize>| {
            let loops = self.mesh.loops(&triangles.iter().copied().collect());
            let (loops, polygons) = loops.into_iter().unzip();
            let surface = Surface::Plane { normal, offset };
            let frame = self.mesh.frame;
            (Face { surface, loops }, Region::Plane { frame, polygons })
        };
        groups(&joined).iter().map(face).collect()
    }
}
