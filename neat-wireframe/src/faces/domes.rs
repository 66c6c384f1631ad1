//! Domes as faces: caps of spheres, within a circle of the wireframe or where they touch a cylinder.

use super::candidates::AGREEMENT;
use super::curves::{Curve, Curves, TURN, measured_points};
use super::face::{CurveIndex, Face, Step};
use super::surface::Surface;
use neat_core::{CircularArc, Dome};

/// What domes add to curves and faces.
pub(super) struct DomeFaces {
    /// The rims that are no arcs of the wireframe.
    pub rims: Vec<Curve>,
    pub caps: Vec<Face>,
}

/// Caps with their normals away from the centre, and the rims of those that end at no arc.
pub(super) fn domes(curves: &Curves, domes: &[Dome]) -> DomeFaces {
    let mut faces = DomeFaces {
        rims: Vec::new(),
        caps: Vec::new(),
    };
    for (index, dome) in domes.iter().enumerate() {
        let arcs = curves.all.iter().filter(|curve| curve.ends.is_none());
        let shown = (arcs.filter_map(|curve| Some((curve.index, curve.arc?))))
            .find(|(_, arc)| is_rim(curves, dome, arc));
        let (curve, rim) = shown.unwrap_or((CurveIndex::Rim(index), dome.rim()));
        if curve.is_inferred() {
            faces.rims.push(inferred_rim(curves, index, &rim));
        }
        // It is to the left of its rim.
        let reversed = rim.normal().dot(&dome.axis) < 0.0;
        faces.caps.push(Face {
            surface: Surface::Sphere {
                center: dome.center,
                radius: dome.radius,
                convex: true,
            },
            loops: vec![vec![Step { curve, reversed }]],
        });
    }
    faces
}

/// Whether a dome ends at a circle.
fn is_rim(curves: &Curves, dome: &Dome, arc: &CircularArc) -> bool {
    let tolerance = AGREEMENT * curves.arc_sigma();
    let rim = dome.rim();
    let tilt = rim.normal().cross(&arc.normal()).norm();
    (arc.center - rim.center).norm() <= tolerance
        && (arc.radius - rim.radius).abs() <= tolerance
        && tilt * arc.radius <= tolerance
}

fn inferred_rim(curves: &Curves, dome: usize, rim: &CircularArc) -> Curve {
    Curve {
        index: CurveIndex::Rim(dome),
        ends: None,
        points: rim.points(TURN),
        measured: (measured_points(rim))
            .map(|point| (point, curves.arc_covariance()))
            .collect(),
        arc: Some(*rim),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::tests::{Model, UNIT, WHOLE, assert_solid, of_triangles};
    use crate::faces::{Shell, ShellGeometry};
    use nalgebra::Vector3;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Around the z axis.
    fn dome(height: f64, radius: f64, reach: f64) -> Dome {
        Dome {
            center: Vector3::z() * height,
            axis: Vector3::z(),
            radius,
            reach,
        }
    }

    fn volume_of_cap(radius: f64, reach: f64) -> f64 {
        let height = radius * (1.0 - reach.cos());
        PI * height * height * (radius - height / 3.0)
    }

    /// A pin with a round end, and one with a ball on its end, each with its volume.
    fn pins() -> [(Model, f64); 2] {
        let base = || Model::default().circle([0.0; 3], 0.4, WHOLE);
        let mut round = base();
        round.domes.push(dome(0.7, 0.4, FRAC_PI_2));
        let of_round = PI * 0.16 * 0.7 + volume_of_cap(0.4, FRAC_PI_2);
        let mut ball = base().circle([0.0, 0.0, 0.7], 0.4, WHOLE);
        let reach = PI - (0.4_f64 / 0.5).asin();
        ball.domes.push(dome(1.0, 0.5, reach));
        let of_ball = PI * 0.16 * 0.7 + volume_of_cap(0.5, reach);
        [(round, of_round), (ball, of_ball)]
    }

    #[test]
    fn pins_with_round_ends_are_solids() {
        for (pin, volume) in pins() {
            assert_solid(pin, 3, volume);
        }
    }

    #[test]
    fn a_dome_is_no_lid_and_its_rim_is_no_edge() {
        let [(round, _), (ball, _)] = pins();
        let rims = |shells: &[Shell]| {
            let curves = shells.iter().flat_map(Shell::curves);
            curves.filter(|curve| *curve == CurveIndex::Rim(0)).count()
        };
        assert_eq!(rims(&round.shells()), 2);
        assert_eq!(rims(&ball.shells()), 0);
        // Without the cylinder that it touches there is nothing to close.
        let mut alone = round;
        alone.arcs.clear();
        let [shell] = &alone.shells()[..] else {
            panic!("a dome is a face");
        };
        assert!(!shell.closed && shell.faces.len() == 1);
    }

    #[test]
    fn a_capsule_is_a_solid_without_any_edge() {
        let mut capsule = Model::default();
        let round = dome(0.7, 0.4, FRAC_PI_2);
        let turned = round.map(|point| Vector3::new(0.0, 0.0, 0.7) - point);
        capsule.domes.extend([round, turned]);
        let volume = PI * 0.16 * 0.7 + 2.0 * volume_of_cap(0.4, FRAC_PI_2);
        assert_solid(capsule, 3, volume);
    }

    #[test]
    fn what_is_seen_within_a_dome_says_that_it_is_no_solid() {
        for (pin, _) in pins() {
            // A wire in the round end, beyond the box of all rims.
            let mut pin = pin.turned();
            let dome = pin.domes[0];
            let at = |share: f64| dome.center + dome.axis * (share * dome.radius);
            pin.wireframe.junctions.extend([at(0.2), at(0.8)]);
            pin.wireframe.edges.push([0, 1]);
            assert!(!pin.shells().iter().any(|shell| shell.closed));
            // One that is hardly longer than junctions are off says nothing.
            pin.wireframe.junctions[1] = at(0.22);
            assert!(pin.shells().iter().all(|shell| shell.closed));
        }
    }

    #[test]
    fn triangles_of_domes_are_watertight() {
        for (pin, volume) in pins() {
            let (of_triangles, watertight) = of_triangles(&pin.turned());
            assert!(watertight);
            let error = of_triangles / (volume * UNIT) - 1.0;
            assert!((-0.01..0.0).contains(&error), "{error}");
        }
    }

    #[test]
    fn in_the_mirror_they_are_the_same() {
        for (mut pin, volume) in pins() {
            let mirrored = |point: &Vector3<f64>| -2.0 * point;
            let shell = pin.shells()[0].map(mirrored);
            pin.arcs = pin.arcs.iter().map(|arc| arc.map(mirrored)).collect();
            pin.domes = pin.domes.iter().map(|dome| dome.map(mirrored)).collect();
            let geometry = ShellGeometry::new(&shell, &pin.graph());
            assert!((geometry.volume(&shell) / (8.0 * volume) - 1.0).abs() < 1e-9);
            assert!(shell.faces.iter().all(|face| geometry.area(face) > 0.0));
        }
    }
}
