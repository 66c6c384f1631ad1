//! Faces on known planes: the junctions that lie in a plane, triangulated with the edges between
//! them, and of the triangles those of which points say that they are surface.

use super::curves::Curves;
use super::explained_planes::explained_planes;
use super::face::Face;
use super::groups::groups;
use super::min_cut::chosen;
use super::plane_fit::{CHI_SQUARE, FittedPlane};
use super::plane_mesh::PlaneMesh;
use super::point_evidence::{
    Densities, PointEvidence, Sign, Witness, for_each_sign, log_ratio_of_sight,
};
use super::region::Region;
use super::selection::{MISSING_FACE, MOST_AGAINST};
use super::surface::Surface;
use nalgebra::Vector3;
use neat_core::Camera;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What hides what is asked so often: the first time nothing hides anything yet.
const ROUNDS: usize = 3;
/// As everything here is told by two views at least, what fewer can see is not known.
const VIEWS: usize = 2;

/// A plane with its triangles, and what points say of them.
struct Sheet {
    plane: (Vector3<f64>, f64),
    mesh: PlaneMesh,
    said: Vec<Said>,
}

/// What a witness, by its place, says of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Said {
    witness: usize,
    triangle: usize,
    sign: Sign,
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
        mut hiding: impl Iterator<Item = &'r Region>,
    ) -> bool {
        let center = &camera.center_in_world;
        let hides = |region: &Region| {
            region.distance_to_surface(place) > self.margin && region.is_between(center, place)
        };
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
    witnesses: &[Witness],
) -> Vec<Face> {
    let measured: Vec<_> = witnesses.iter().map(|witness| witness.measured).collect();
    let planes = explained_planes(curves, &measured);
    let sheets: Vec<Sheet> = (planes.par_iter())
        .filter_map(|plane| Sheet::new(curves, &plane.solved()?, witnesses))
        .collect();
    let margin = (CHI_SQUARE * curves.junction_floor()[0]).sqrt();
    let sight = Sight { cameras, margin };
    open.retain(|(_, region)| log_ratio_of_sight(region, witnesses, margin) >= -MOST_AGAINST);
    let mut placed: Vec<Vec<Placed>> = sheets.iter().map(|_| Vec::new()).collect();
    for round in 0..ROUNDS {
        // A point lies on one face: on that of the plane that explains most.
        let mut taken = vec![false; witnesses.len()];
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
            placed[place] = sheet.faces(may_be, &mut taken);
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

impl Sheet {
    fn new(curves: &Curves, plane: &FittedPlane, witnesses: &[Witness]) -> Option<Self> {
        let mesh = PlaneMesh::new(curves, plane)?;
        let mut said = Vec::new();
        for (place, witness) in witnesses.iter().enumerate() {
            for_each_sign(witness, plane, |point, sign| {
                said.extend(mesh.triangle_at(&point).map(|triangle| Said {
                    witness: place,
                    triangle,
                    sign,
                }));
            });
        }
        // From however many views: once.
        said.sort_unstable();
        said.dedup();
        Some(Self {
            plane: plane.plane(),
            mesh,
            said,
        })
    }

    /// Of each triangle what points say that are not taken, and how many are beside the plane.
    fn evidence(&self, taken: &[bool]) -> (BTreeMap<usize, PointEvidence>, usize) {
        let mut of_triangles: BTreeMap<usize, PointEvidence> = (self.mesh.triangles())
            .map(|(triangle, area, _)| (triangle, PointEvidence::of_area(area)))
            .collect();
        let mut beside = 0;
        for said in &self.said {
            let of_triangle = of_triangles.entry(said.triangle).or_default();
            match said.sign {
                Sign::On => of_triangle.on += usize::from(!taken[said.witness]),
                Sign::Beside => beside += 1,
                Sign::Through => of_triangle.through += 1,
            }
        }
        (of_triangles, beside)
    }

    /// Takes the points on the faces that it finds.
    fn faces(&self, may_be: impl Fn(&Vector3<f64>) -> bool, taken: &mut [bool]) -> Vec<Placed> {
        let (of_triangles, beside) = self.evidence(taken);
        let Some(densities) = Densities::of(of_triangles.values(), beside) else {
            return Vec::new();
        };
        let possible = (self.mesh.triangles()).filter(|(_, _, centroid)| may_be(centroid));
        let mut gains: BTreeMap<usize, f64> = possible
            .map(|(triangle, _, _)| (triangle, of_triangles[&triangle].log_ratio(&densities)))
            .collect();
        let mut costs = BTreeMap::new();
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
        let pairs = sides.iter().map(|(pair, _)| pair.to_vec());
        let mut joined: Vec<Vec<usize>> = pairs
            .filter(|pair| pair.iter().all(|triangle| kept.contains(triangle)))
            .collect();
        joined.extend(kept.iter().map(|triangle| vec![*triangle]));
        for said in &self.said {
            taken[said.witness] |= said.sign == Sign::On && kept.contains(&said.triangle);
        }
        let (normal, offset) = self.plane;
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
