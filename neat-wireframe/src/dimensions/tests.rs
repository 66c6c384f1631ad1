use super::*;
use crate::faces::{CurveIndex, MeasuredGraph, Shell, Step, Surface, find_shells};
use crate::test_scenes::{Noise, cube};
use neat_core::CircularArc;

/// Nearly normal with standard deviation 1: the sum of twelve uniform numbers.
fn normal(noise: &mut Noise) -> f64 {
    (0..12).map(|_| noise.uniform()).sum::<f64>() * 0.5
}

/// The cube with a covariance of its own at each junction, and the roots of these.
fn unsure_cube(sigma: f64) -> (WireframeDocument, Vec<Matrix3<f64>>) {
    let (junctions, edges) = cube();
    let mut noise = Noise(3);
    let root = |_| Matrix3::from_fn(|_, _| sigma * noise.uniform());
    let roots: Vec<Matrix3<f64>> = (0..junctions.len()).map(root).collect();
    let covariances = roots.iter().map(|root| {
        let c = root * root.transpose();
        Some([
            c[(0, 0)],
            c[(0, 1)],
            c[(0, 2)],
            c[(1, 1)],
            c[(1, 2)],
            c[(2, 2)],
        ])
    });
    let document = WireframeDocument {
        junction_covariances: covariances.collect(),
        junctions: junctions.to_vec(),
        edges: edges.to_vec(),
        ..WireframeDocument::default()
    };
    (document, roots)
}

/// Of the cube and perhaps more edges.
fn all_quantities(edges: usize) -> Vec<Quantity> {
    let pairs = (0..edges).flat_map(|a| (a + 1..edges).map(move |b| [a, b]));
    let mut all: Vec<_> = (0..edges).map(|edge| Quantity::Length { edge }).collect();
    all.extend((1..8).map(|b| Quantity::Distance { junctions: [0, b] }));
    all.extend(pairs.clone().map(|edges| Quantity::Angle { edges }));
    all.extend(pairs.map(|edges| Quantity::Gap { edges }));
    all
}

#[test]
fn a_cube_has_the_dimensions_of_one() {
    let (document, _) = unsure_cube(0.0);
    let side = (document.junctions[document.edges[0][0]]
        - document.junctions[document.edges[0][1]])
        .norm();
    let dimensions = Dimensions::new(&document, None).unwrap();
    let lengths = dimensions.lengths();
    assert_eq!(lengths.len(), 12);
    for length in &lengths {
        assert!((length.value - side).abs() < 1e-12 && !length.free_end);
    }
    let parallels = dimensions.parallels(100);
    assert_eq!(parallels.len(), 18);
    for gap in &parallels {
        let sides = gap.value / side;
        assert!((sides - 1.0).abs() < 1e-9 || (sides - 2f64.sqrt()).abs() < 1e-9);
    }
    assert_eq!(dimensions.parallels(5).len(), 5);
    for quantity in all_quantities(12) {
        if let Quantity::Angle { .. } = quantity {
            let angle = dimensions.measure(quantity).unwrap().value;
            assert!(angle.abs() < 1e-6 || (angle - 90.0).abs() < 1e-6);
        }
    }
}

#[test]
fn scatter_is_what_is_said() {
    let (mut document, roots) = unsure_cube(2e-3);
    // A diagonal of a face or of the whole, which is not at right angles to all others.
    let from_first = |b: &usize| (document.junctions[*b] - document.junctions[0]).norm();
    let farthest = (1..8).max_by(|a, b| from_first(a).total_cmp(&from_first(b)));
    document.edges.push([0, farthest.unwrap()]);
    let scale: Scale = "0-1=5m±0.02".parse().unwrap();
    for scale in [None, Some(scale)] {
        let said = Dimensions::new(&document, scale).unwrap();
        // Angles are folded at 0 and 90, and of crossing edges of one length either may be the
        // shorter one.
        let smooth = |quantity: &Quantity| match *quantity {
            Quantity::Gap { edges } => {
                let angle = said.measure(Quantity::Angle { edges }).unwrap();
                angle.value < 1.0
            }
            Quantity::Angle { edges } => edges[0] == 12 || edges[1] == 12,
            _ => true,
        };
        let quantities: Vec<Quantity> = all_quantities(13).into_iter().filter(smooth).collect();
        assert!(quantities.len() > 30);
        let mut noise = Noise(17);
        let mut squares = vec![0.0; quantities.len()];
        const TRIALS: usize = 3000;
        for _ in 0..TRIALS {
            let mut moved = document.clone();
            for (junction, root) in moved.junctions.iter_mut().zip(&roots) {
                *junction += root * Vector3::from_fn(|_, _| normal(&mut noise));
            }
            let scale = scale.map(|scale| Scale {
                length: scale.length + scale.sigma * normal(&mut noise),
                ..scale
            });
            let seen = Dimensions::new(&moved, scale).unwrap();
            for (sum, quantity) in squares.iter_mut().zip(&quantities) {
                let error =
                    seen.measure(*quantity).unwrap().value - said.measure(*quantity).unwrap().value;
                *sum += error * error;
            }
        }
        for (sum, quantity) in squares.iter().zip(&quantities) {
            let sigma = said.measure(*quantity).unwrap().sigma.unwrap();
            let scatter = (sum / TRIALS as f64).sqrt();
            assert!(
                (scatter - sigma).abs() < 0.06 * sigma + 1e-9,
                "{quantity:?}: scatters by {scatter}, said {sigma}"
            );
        }
    }
}

#[test]
fn intervals_of_small_angles_hold_zero() {
    let (truth, roots) = unsure_cube(5e-3);
    let edges = truth.edges.clone();
    let is_parallel = |[a, b]: [usize; 2]| {
        let along = |e: usize| truth.junctions[edges[e][1]] - truth.junctions[edges[e][0]];
        geometry::angle(&along(a), &along(b)) < 1.0
    };
    let pairs: Vec<[usize; 2]> = (0..12)
        .flat_map(|a| (a + 1..12).map(move |b| [a, b]))
        .filter(|pair| is_parallel(*pair))
        .collect();
    let mut noise = Noise(29);
    let (mut held, mut all) = (0, 0);
    for _ in 0..300 {
        let mut seen = truth.clone();
        for (junction, root) in seen.junctions.iter_mut().zip(&roots) {
            *junction += root * Vector3::from_fn(|_, _| normal(&mut noise));
        }
        let dimensions = Dimensions::new(&seen, None).unwrap();
        for edges in &pairs {
            let angle = dimensions
                .measure(Quantity::Angle { edges: *edges })
                .unwrap();
            let [low, high] = angle.interval.unwrap();
            assert!(low <= angle.value && angle.value <= high);
            held += usize::from(low <= 0.0);
            all += 1;
        }
    }
    let share = f64::from(u32::try_from(held).unwrap()) / f64::from(all);
    assert!(share > 0.95, "{share}");
}

#[test]
fn what_is_not_determined_has_no_interval_and_free_ends_are_told() {
    let (mut document, _) = unsure_cube(1e-3);
    document.junction_covariances[document.edges[0][1]] = None;
    let end = document.junctions.len();
    document.junctions.push(document.junctions[0] * 2.0);
    document.edges.push([0, end]);
    document
        .junction_covariances
        .push(Some([1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6]));
    let dimensions = Dimensions::new(&document, None).unwrap();
    let first = dimensions.measure(Quantity::Length { edge: 0 }).unwrap();
    assert_eq!((first.sigma, first.interval), (None, None));
    let last = dimensions.measure(Quantity::Length { edge: 12 }).unwrap();
    assert!(last.free_end && last.interval.is_some());
    document.junction_covariances.clear();
    let without = Dimensions::new(&document, None).unwrap();
    assert!(
        without
            .lengths()
            .iter()
            .all(|length| length.interval.is_none())
    );
    assert!(!without.parallels(1000).is_empty());
}

#[test]
fn what_cannot_be_measured_is_told() {
    let (mut document, _) = unsure_cube(0.0);
    document.junctions.push(document.junctions[0]);
    document.edges.push([0, 8]);
    let dimensions = Dimensions::new(&document, None).unwrap();
    let said = |quantity| dimensions.measure(quantity).unwrap_err().to_string();
    assert!(said(Quantity::Length { edge: 13 }).contains("no edge 13"));
    assert!(said(Quantity::Distance { junctions: [0, 9] }).contains("no junction 9"));
    assert!(said(Quantity::Angle { edges: [4, 4] }).contains("named twice"));
    assert!(said(Quantity::Length { edge: 12 }).contains("one place"));
    assert_eq!(dimensions.lengths().len(), 12);
    for bad in ["0-8=1m", "0-99=1m", "3-3=1m"] {
        assert!(
            Dimensions::new(&document, Some(bad.parse().unwrap())).is_err(),
            "{bad}"
        );
    }
    let empty = WireframeDocument::default();
    let nothing = Dimensions::new(&empty, None).unwrap();
    assert!(nothing.lengths().is_empty() && nothing.parallels(9).is_empty());
}

#[test]
fn scales_are_read() {
    let scale: Scale = "3-17=3.20m".parse().unwrap();
    assert_eq!(
        (scale.junctions, scale.length, scale.sigma, scale.unit),
        ([3, 17], 3.2, 0.0, "m")
    );
    for text in ["0-1=12 in ± 0.5", "0-1=12in+-0.5in", " 0 - 1 = 12in±0.5"] {
        let scale: Scale = text.parse().unwrap();
        assert_eq!((scale.length, scale.unit), (12.0, "in"), "{text}");
        assert!((scale.sigma * INTERVAL - 0.5).abs() < 1e-12);
    }
    for bad in [
        "",
        "3-17",
        "3-17=",
        "3-17=3.2",
        "3-17=m",
        "3-17=0m",
        "3-17=-1m",
        "3-17=1km",
        "3=1m",
        "a-b=1m",
        "3-17=infm",
        "3-17=NaNm",
        "3-17=1m±",
        "3-17=1m±-1",
        "3-17=1m±1mm",
        "-1-2=3m",
    ] {
        assert!(bad.parse::<Scale>().is_err(), "{bad}");
    }
}

#[test]
fn holes_have_radii_and_spacings() {
    let (mut document, _) = unsure_cube(0.0);
    document.arcs = [0.0, 3.0]
        .map(|x| CircularArc {
            center: Vector3::new(x, 4.0 * x / 3.0, 0.0),
            axes: [Vector3::x(), Vector3::y()],
            radius: 0.5,
            angles: [0.0, 2.0],
        })
        .to_vec();
    // Centres by .03 and .04 in x, radii by .01, and both together, which no spacing asks.
    let of_arc = |x: f64| Some([x, 0.0, 0.0, 2e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4]);
    document.arc_covariances = vec![of_arc(9e-4), of_arc(16e-4)];
    let dimensions = Dimensions::new(&document, None).unwrap();
    let radii = dimensions.radii();
    assert_eq!(radii.len(), 2);
    for radius in radii {
        let [low, high] = radius.interval.unwrap();
        assert!((radius.value - 0.5).abs() < 1e-12 && (radius.sigma.unwrap() - 0.01).abs() < 1e-9);
        assert!((high - low - 2.0 * INTERVAL * 0.01).abs() < 1e-9);
    }
    let spacing = dimensions
        .measure(Quantity::Spacing { arcs: [0, 1] })
        .unwrap();
    assert!((spacing.value - 5.0).abs() < 1e-12);
    // By .05 in x, along which the centres are 3 of 5 apart.
    assert!((spacing.sigma.unwrap() - 0.03).abs() < 1e-8);

    // The side of the cube is truly 10 m.
    let [a, b] = document.edges[0];
    let side = (document.junctions[b] - document.junctions[a]).norm();
    let scale = format!("{a}-{b}=10m").parse().unwrap();
    let scaled = Dimensions::new(&document, Some(scale)).unwrap();
    let radius = scaled.measure(Quantity::Radius { arc: 1 }).unwrap();
    assert!((radius.value - 5.0 / side).abs() < 1e-9);
    assert!((radius.sigma.unwrap() - 0.1 / side).abs() < 1e-9);

    let said = |quantity| dimensions.measure(quantity).unwrap_err().to_string();
    assert!(said(Quantity::Radius { arc: 2 }).contains("no arc 2"));
    assert!(said(Quantity::Spacing { arcs: [1, 1] }).contains("arc 1 is named twice"));
    document.arc_covariances.clear();
    let unknown = Dimensions::new(&document, None).unwrap();
    assert_eq!(unknown.radii()[0].interval, None);
}

/// The cube with its faces.
fn cube_with_faces(sigma: f64) -> (WireframeDocument, Vec<Matrix3<f64>>) {
    let (mut document, roots) = unsure_cube(sigma);
    let wireframe = document.wireframe();
    let graph = MeasuredGraph::of(&wireframe);
    document.shells = find_shells(&graph, &[], &[]);
    (document, roots)
}

#[test]
fn a_cube_has_six_areas_that_scatter_as_is_said() {
    let (document, roots) = cube_with_faces(2e-3);
    for scale in [None, Some("0-1=5m±0.02".parse::<Scale>().unwrap())] {
        let said = Dimensions::new(&document, scale).unwrap().areas();
        assert_eq!(said.len(), 6);
        let mut noise = Noise(29);
        let mut squares = [0.0; 6];
        const TRIALS: usize = 3000;
        for _ in 0..TRIALS {
            let mut moved = document.clone();
            for (junction, root) in moved.junctions.iter_mut().zip(&roots) {
                *junction += root * Vector3::from_fn(|_, _| normal(&mut noise));
            }
            let scale = scale.map(|scale| Scale {
                length: scale.length + scale.sigma * normal(&mut noise),
                ..scale
            });
            let seen = Dimensions::new(&moved, scale).unwrap().areas();
            for (sum, (seen, said)) in squares.iter_mut().zip(seen.iter().zip(&said)) {
                *sum += (seen.value - said.value).powi(2);
            }
        }
        for (sum, area) in squares.iter().zip(&said) {
            let (scatter, sigma) = ((sum / TRIALS as f64).sqrt(), area.sigma.unwrap());
            assert!(
                (scatter - sigma).abs() < 0.06 * sigma,
                "scatters by {scatter}, said {sigma}"
            );
        }
    }
    let exact = cube_with_faces(0.0).0;
    let side = (exact.junctions[exact.edges[0][0]] - exact.junctions[exact.edges[0][1]]).norm();
    let dimensions = Dimensions::new(&exact, None).unwrap();
    assert!((dimensions.areas().iter()).all(|area| (area.value - side * side).abs() < 1e-9));
    let missing = dimensions.measure(Quantity::Area { face: 6 }).unwrap_err();
    assert!(missing.to_string().contains("no face 6"));
}

fn plane_face(loops: Vec<Vec<Step>>) -> Shell {
    let surface = Surface::Plane {
        normal: Vector3::z(),
        offset: 0.0,
    };
    Shell {
        closed: false,
        faces: vec![Face { surface, loops }],
    }
}

fn step(curve: CurveIndex) -> Step {
    Step {
        curve,
        reversed: false,
    }
}

/// Three sides of a rectangle of 2 by 1 with a flat arc over it, which is known to a hundredth at
/// its ends and in its middle; with the root of the covariance of its centre's x and y and its
/// radius.
fn arched() -> (WireframeDocument, Matrix3<f64>) {
    let rise = 0.1_f64;
    let radius = (1.0 + rise * rise) / (2.0 * rise);
    let center = Vector3::new(1.0, 1.0 + rise - radius, 0.0);
    let half = (1.0 / radius).asin();
    let middle = std::f64::consts::FRAC_PI_2;
    // Of centre x, centre y and radius by three points along their normals.
    let rows = [middle - half, middle, middle + half].map(|angle| {
        let (sine, cosine) = angle.sin_cos();
        [cosine, sine, 1.0]
    });
    let by_points = Matrix3::from_fn(|row, column| rows[row][column]);
    let root = by_points.try_inverse().unwrap() * 0.01;
    let c = root * root.transpose();
    let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];
    let edges = [[0, 1], [1, 2], [3, 0]];
    let curves = [CurveIndex::Edge(0), CurveIndex::Edge(1)]
        .into_iter()
        .chain([CurveIndex::Arc(0), CurveIndex::Edge(2)]);
    let document = WireframeDocument {
        junctions: corners.map(|[x, y]| Vector3::new(x, y, 0.0)).to_vec(),
        edges: edges.to_vec(),
        arcs: vec![CircularArc {
            center,
            axes: [Vector3::x(), Vector3::y()],
            radius,
            angles: [middle - half, middle + half],
        }],
        junction_covariances: vec![Some([1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6]); 4],
        arc_covariances: vec![Some([
            c[(0, 0)],
            c[(0, 1)],
            0.0,
            c[(0, 2)],
            c[(1, 1)],
            0.0,
            c[(1, 2)],
            0.0,
            0.0,
            c[(2, 2)],
        ])],
        shells: vec![plane_face(vec![curves.map(step).collect()])],
        ..WireframeDocument::default()
    };
    (document, root)
}

#[test]
fn an_arc_is_as_sure_as_its_points_however_unsure_its_centre_is() {
    let (document, root) = arched();
    document.check(std::path::Path::new("arched")).unwrap();
    let said = Dimensions::new(&document, None).unwrap().areas()[0].clone();
    let (radius, half) = (document.arcs[0].radius, 0.5 * document.arcs[0].sweep());
    let segment = radius * radius * (half - half.sin() * half.cos());
    assert!((said.value - 2.0 - segment).abs() < 1e-9);
    let sigma = said.sigma.unwrap();
    // With a radius that were unsure alone, it would be by as much again for each unit of chord.
    let of_radius = document.arc_covariances[0].unwrap()[9].sqrt();
    assert!(sigma < 0.02 && of_radius > 0.5, "{sigma} {of_radius}");
    let mut noise = Noise(7);
    let mut sum = 0.0;
    const TRIALS: usize = 4000;
    for _ in 0..TRIALS {
        let mut moved = document.clone();
        for junction in &mut moved.junctions {
            *junction += 1e-3 * Vector3::from_fn(|_, _| normal(&mut noise));
        }
        // A fiftieth of it: a curve is as straight as that.
        let by = root * Vector3::from_fn(|_, _| normal(&mut noise)) * 0.02;
        moved.arcs[0].center += Vector3::new(by.x, by.y, 0.0);
        moved.arcs[0].radius += by.z;
        let seen = Dimensions::new(&moved, None).unwrap().areas()[0].clone();
        sum += (seen.value - said.value).powi(2);
    }
    let mut surer = document;
    let small = surer.arc_covariances[0].unwrap().map(|x| x * 0.02 * 0.02);
    surer.arc_covariances = vec![Some(small)];
    let said = Dimensions::new(&surer, None).unwrap().areas()[0].clone();
    let (scatter, sigma) = ((sum / TRIALS as f64).sqrt(), said.sigma.unwrap());
    assert!((scatter - sigma).abs() < 0.06 * sigma, "{scatter} {sigma}");
}

#[test]
fn holes_are_no_area_and_cylinders_have_one() {
    let (mut document, _) = arched();
    let circle = |z: f64| CircularArc {
        center: Vector3::new(1.0, 0.5, z),
        axes: [Vector3::x(), Vector3::y()],
        radius: 0.25,
        angles: [0.0, std::f64::consts::TAU],
    };
    document.arcs.extend([circle(0.0), circle(2.0)]);
    let radius_only = |sigma: f64| {
        let mut of_arc = [0.0; 10];
        of_arc[9] = sigma * sigma;
        Some(of_arc)
    };
    document
        .arc_covariances
        .extend([radius_only(0.01), radius_only(0.02)]);
    let whole = Dimensions::new(&document, None).unwrap().areas()[0].value;
    let hole = Step {
        curve: CurveIndex::Arc(1),
        reversed: true,
    };
    document.shells[0].faces[0].loops.push(vec![hole]);
    document.shells[0].faces.push(Face {
        surface: Surface::Cylinder {
            point: Vector3::new(1.0, 0.5, 0.0),
            axis: Vector3::z(),
            radius: 0.25,
            convex: false,
        },
        loops: vec![
            vec![step(CurveIndex::Arc(1))],
            vec![step(CurveIndex::Arc(2))],
        ],
    });
    let areas = Dimensions::new(&document, None).unwrap().areas();
    let pi = std::f64::consts::PI;
    assert!((whole - areas[0].value - pi * 0.0625).abs() < 1e-9);
    assert!((areas[1].value - pi).abs() < 1e-9);
    // The mean of both radii, by the way around for each of two units.
    let expected = 2.0 * pi * 2.0 * 0.5 * 0.01_f64.hypot(0.02);
    assert!((areas[1].sigma.unwrap() - expected).abs() < 1e-6);
    document.arc_covariances.clear();
    let unknown = Dimensions::new(&document, None).unwrap().areas();
    assert!(unknown.iter().all(|area| area.interval.is_none()));
}
