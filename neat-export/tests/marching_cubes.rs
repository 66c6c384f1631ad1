//! Meshes of solids whose volume and area are known, and of random fields, whose
//! cubes meet every ambiguous case.

use nalgebra::Vector3;
use neat_export::marching_cubes::{Grid, Region, marching_cubes};
use neat_export::{ExportError, TriangleMesh};
use neat_wireframe::SignedDistance;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// A distance given by a formula.
struct Formula<F>(F);

impl<F: Fn(&Vector3<f64>) -> f64> SignedDistance for Formula<F> {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(&self.0).collect()
    }

    fn sdf_and_gradient(&self, _: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        panic!("marching cubes needs no gradient")
    }
}

fn grid(radius: f64, resolution: usize) -> Grid {
    Grid {
        region: Region::Box {
            min: Vector3::repeat(-radius),
            max: Vector3::repeat(radius),
        },
        resolution,
        closed: true,
        max_slope: None,
    }
}

fn mesh(sdf: impl Fn(&Vector3<f64>) -> f64, grid: &Grid) -> TriangleMesh {
    marching_cubes(&Formula(sdf), grid, &mut |_| ()).unwrap()
}

/// How often each directed edge occurs.
fn directed_edges(mesh: &TriangleMesh) -> BTreeMap<[u32; 2], usize> {
    let mut count = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *count.entry(edge).or_default() += 1;
        }
    }
    count
}

/// Every edge belongs to two triangles, which run along it in opposite directions,
/// and every vertex to some triangle.
fn assert_watertight(mesh: &TriangleMesh) {
    let edges = directed_edges(mesh);
    for ([a, b], count) in &edges {
        assert!(a != b, "a triangle with a vertex twice");
        assert_eq!(
            (*count, edges.get(&[*b, *a])),
            (1, Some(&1)),
            "edge {a} {b}"
        );
    }
    let mut used = vec![false; mesh.vertices.len()];
    for vertex in mesh.triangles.iter().flatten() {
        used[*vertex as usize] = true;
    }
    assert!(used.iter().all(|used| *used));
}

fn euler_characteristic(mesh: &TriangleMesh) -> i64 {
    let directed = directed_edges(mesh);
    let undirected: BTreeSet<_> = directed.keys().map(|[a, b]| [a.min(b), a.max(b)]).collect();
    let edges = undirected.len();
    mesh.vertices.len() as i64 - edges as i64 + mesh.triangles.len() as i64
}

fn corners(mesh: &TriangleMesh) -> impl Iterator<Item = [Vector3<f64>; 3]> {
    let corners = |t: &[u32; 3]| t.map(|vertex| mesh.vertices[vertex as usize]);
    mesh.triangles.iter().map(corners)
}

fn area(mesh: &TriangleMesh) -> f64 {
    corners(mesh)
        .map(|[a, b, c]| (b - a).cross(&(c - a)).norm() / 2.0)
        .sum()
}

/// Positive where triangles are counter-clockwise as seen from outside.
fn volume(mesh: &TriangleMesh) -> f64 {
    corners(mesh)
        .map(|[a, b, c]| a.cross(&b).dot(&c) / 6.0)
        .sum()
}

#[track_caller]
fn assert_close(value: f64, expected: f64, relative: f64) {
    assert!(
        (value / expected - 1.0).abs() < relative,
        "{value}, not {expected}"
    );
}

fn box_sdf(p: &Vector3<f64>, half: Vector3<f64>) -> f64 {
    let q = p.abs() - half;
    q.sup(&Vector3::zeros()).norm() + q.max().min(0.0)
}

#[test]
fn a_sphere_converges_with_the_square_of_the_spacing() {
    let center = Vector3::new(0.03, -0.02, 0.01);
    let mut errors = Vec::new();
    for resolution in [16, 32, 64] {
        let mesh = mesh(|p| (p - center).norm() - 0.7, &grid(1.0, resolution));
        assert_watertight(&mesh);
        assert_eq!(euler_characteristic(&mesh), 2);
        errors.push(volume(&mesh) / (4.0 / 3.0 * PI * 0.7f64.powi(3)) - 1.0);
        if resolution == 64 {
            assert_close(area(&mesh), 4.0 * PI * 0.49, 2e-3);
        }
        let spacing = 2.0 / resolution as f64;
        let off = |p: &Vector3<f64>| ((p - center).norm() - 0.7).abs();
        let worst = mesh.vertices.iter().map(off).fold(0.0, f64::max);
        // Linear interpolation errs by at most spacing² · curvature / 8.
        assert!(worst <= spacing * spacing / 0.7 / 8.0, "{worst}");
    }
    assert!(errors[2].abs() < 2e-3, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.5, "{errors:?}");
    }
}

#[test]
fn a_box_has_its_volume_and_area() {
    let half = Vector3::new(0.71, 0.43, 0.57);
    let mesh = mesh(|p| box_sdf(p, half), &grid(1.0, 80));
    assert_watertight(&mesh);
    assert_eq!(euler_characteristic(&mesh), 2);
    assert_close(volume(&mesh), 8.0 * half.product(), 1e-2);
    let faces = half.x * half.y + half.y * half.z + half.z * half.x;
    // Marching cubes cut off sharp edges, by less than a cube.
    assert_close(area(&mesh), 8.0 * faces, 2e-2);
}

#[test]
fn a_torus_has_a_hole_and_two_spheres_are_two_parts() {
    let torus = |p: &Vector3<f64>| (p.xy().norm() - 0.6).hypot(p.z) - 0.25;
    let of_torus = mesh(torus, &grid(1.0, 40));
    assert_watertight(&of_torus);
    assert_eq!(euler_characteristic(&of_torus), 0);
    assert_close(
        volume(&of_torus),
        2.0 * PI * PI * 0.6 * 0.25f64.powi(2),
        1e-2,
    );

    let x = Vector3::x() * 0.5;
    let two = mesh(|p| (p - x).norm().min((p + x).norm()) - 0.3, &grid(1.0, 40));
    assert_watertight(&two);
    assert_eq!(euler_characteristic(&two), 4);
}

/// Random values at every point of the grid: all sign patterns, all ambiguous faces.
#[test]
fn random_fields_have_no_holes() {
    for seed in 0..40 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // A hash of the point: the layers must agree on it.
        let offsets: Vec<f64> = (0..4096).map(|_| random.random_range(-1.0..1.0)).collect();
        let share_inside: f64 = random.random_range(-0.6..0.6);
        let field = |p: &Vector3<f64>| {
            let bits = p.map(|x| (x * 64.0).round() as i64 as u64);
            let hash = bits.x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
                ^ bits.y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
                ^ bits.z.wrapping_mul(0x1656_67b1_9e37_79f9);
            offsets[(hash >> 40) as usize % offsets.len()] + share_inside
        };
        let mesh = mesh(field, &grid(1.0, 16));
        assert!(mesh.triangles.len() > 500);
        assert_watertight(&mesh);
        assert!(volume(&mesh) > 0.0);
    }
}

#[test]
fn distances_of_exactly_zero_leave_no_holes() {
    // The faces of the solid lie on points of the grid.
    let mesh = mesh(|p| p.amax() - 0.5, &grid(1.0, 16));
    assert_watertight(&mesh);
    assert_eq!(euler_characteristic(&mesh), 2);
    // Half a cube is missing along each of the twelve edges, less at the corners.
    let missing = 1.0 - volume(&mesh);
    assert!(
        missing > 0.0 && missing < 12.0 / 2.0 * 0.125 * 0.125,
        "{missing}"
    );
}

#[test]
fn the_region_closes_what_leaves_it_or_leaves_it_open() {
    let ball = Region::Ball {
        center: Vector3::new(1000.0, 0.0, -3.0),
        radius: 2.0,
    };
    let mut grid = Grid {
        region: ball,
        resolution: 60,
        closed: true,
        max_slope: None,
    };
    let half_space = |p: &Vector3<f64>| p.x - 1000.0;
    let closed = mesh(half_space, &grid);
    assert_watertight(&closed);
    assert_eq!(euler_characteristic(&closed), 2);
    assert_close(volume(&closed), 2.0 / 3.0 * PI * 8.0, 1e-2);

    grid.closed = false;
    let open = mesh(half_space, &grid);
    assert_eq!(euler_characteristic(&open), 1);
    assert!(open.vertices.iter().all(|p| (p.x - 1000.0).abs() < 1e-9));
    // Only whole cubes inside the ball.
    assert!(area(&open) < PI * 4.0 && area(&open) > 0.9 * PI * 4.0);
    assert!(corners(&open).all(|[a, b, c]| (b - a).cross(&(c - a)).x >= 0.0));
}

#[test]
fn empty_and_full_regions_and_boxes_of_any_shape() {
    assert_eq!(mesh(|_| 1.0, &grid(1.0, 8)), TriangleMesh::default());
    let flat = Grid {
        region: Region::Box {
            min: Vector3::new(0.0, 10.0, 5.0),
            max: Vector3::new(4.0, 11.0, 5.25),
        },
        resolution: 64,
        closed: true,
        max_slope: None,
    };
    let full = mesh(|_| -1.0, &flat);
    assert_watertight(&full);
    assert_close(volume(&full), 1.0, 5e-2);
}

#[test]
fn progress_rises_to_one_and_queries_are_bounded() {
    struct Counting;
    impl SignedDistance for Counting {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            assert!(!points.is_empty() && points.len() <= 1 << 16);
            points.iter().map(|p| p.norm() - 0.5).collect()
        }
        fn sdf_and_gradient(&self, _: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            Vec::new()
        }
    }
    let mut shares = Vec::new();
    let mut grid = grid(1.0, 300);
    // Few layers of many points.
    grid.region = Region::Box {
        min: Vector3::new(-1.0, -1.0, -0.01),
        max: Vector3::new(1.0, 1.0, 0.01),
    };
    marching_cubes(&Counting, &grid, &mut |share| shares.push(share)).unwrap();
    assert!(shares.is_sorted() && shares.last() == Some(&1.0));
}

#[test]
fn far_blocks_cost_one_evaluation_and_change_nothing() {
    let evaluated = Cell::new(0);
    let torus = |p: &Vector3<f64>| {
        evaluated.set(evaluated.get() + 1);
        (p.xy().norm() - 0.6).hypot(p.z) - 0.25
    };
    let mut counts = Vec::new();
    for closed in [true, false] {
        let mut meshes = Vec::new();
        for max_slope in [None, Some(1.0), Some(2.0)] {
            let grid = Grid {
                closed,
                max_slope,
                ..grid(0.7, 100)
            };
            meshes.push(mesh(torus, &grid));
            counts.push(evaluated.take());
        }
        assert_eq!(meshes[0], meshes[1]);
        assert_eq!(meshes[0], meshes[2]);
    }
    let [all, few, more] = counts[..3] else {
        panic!("three grids")
    };
    assert!(few < more && more < all && few < all / 2, "{counts:?}");

    // Even a slope that is wrong makes no holes.
    let steep = mesh(
        |p| 9.0 * (p.norm() - 0.5),
        &Grid {
            max_slope: Some(1.0),
            ..grid(1.0, 50)
        },
    );
    assert_watertight(&steep);
}

#[test]
fn bad_numbers_are_errors() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let field = Formula(|p: &Vector3<f64>| if p.x > 0.3 { value } else { p.y });
        let error = marching_cubes(&field, &grid(1.0, 8), &mut |_| ()).unwrap_err();
        assert!(matches!(error, ExportError::BadDistance { .. }), "{error}");
    }
    let sphere = Formula(|p: &Vector3<f64>| p.norm() - 0.5);
    let nowhere = Region::Ball {
        center: Vector3::zeros(),
        radius: f64::NAN,
    };
    let bad = [
        Grid {
            resolution: 1,
            ..grid(1.0, 8)
        },
        Grid {
            resolution: usize::MAX,
            ..grid(1.0, 8)
        },
        grid(0.0, 8),
        grid(-1.0, 8),
        grid(f64::INFINITY, 8),
        Grid {
            region: nowhere,
            ..grid(1.0, 8)
        },
        Grid {
            max_slope: Some(0.0),
            ..grid(1.0, 8)
        },
        Grid {
            max_slope: Some(f64::NAN),
            ..grid(1.0, 8)
        },
    ];
    for grid in bad {
        let error = marching_cubes(&sphere, &grid, &mut |_| ()).unwrap_err();
        assert!(matches!(error, ExportError::BadOption { .. }), "{error}");
    }
}

#[test]
fn a_mesh_file_reads_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mesh.ply");
    let mesh = mesh(|p| p.norm() - 0.5, &grid(1.0, 8)).map(|p| p * 3.0 + Vector3::repeat(5e5));
    mesh.write_ply(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    assert!(header.contains(&format!("element vertex {}\n", mesh.vertices.len())));
    assert!(header.contains(&format!("element face {}\n", mesh.triangles.len())));
    let (vertices, faces) = bytes[body..].split_at(24 * mesh.vertices.len());
    let numbers: Vec<f64> = vertices
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    let written: Vec<f64> = mesh.vertices.iter().flatten().copied().collect();
    assert_eq!(numbers, written);
    let triangles: Vec<[u32; 3]> = faces
        .chunks_exact(13)
        .map(|face| {
            assert_eq!(face[0], 3);
            [1, 5, 9].map(|at| u32::from_le_bytes(face[at..at + 4].try_into().unwrap()))
        })
        .collect();
    assert_eq!(triangles, mesh.triangles);
}
