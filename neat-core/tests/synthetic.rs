//! Synthetic scenes against brute force: every exact answer is compared with a
//! slow, independent one.

use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::layout::abc::write_scene;
use neat_core::synthetic::{
    Frustum, PlanarFace, Solid, SyntheticData, SyntheticScene, generate, generate_on_demand,
    render, visible_parts,
};
use neat_core::{Camera, Intrinsics, LineSegment2, LoadOptions, Ray, Similarity, load_scene};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Vec3 = Vector3<f64>;

/// Small images and few views; everything else as by default.
fn small(solid: Solid) -> SyntheticScene {
    SyntheticScene {
        solid,
        views: 12,
        image_size: 128,
        ..SyntheticScene::default()
    }
}

/// A detector that sees all there is and nothing else.
fn perfect(solid: Solid) -> SyntheticScene {
    SyntheticScene {
        noise_in_pixels: 0.0,
        detection_rate: 1.0,
        false_segments: 0,
        min_visible_length: 0.0,
        ..small(solid)
    }
}

fn data(config: &SyntheticScene) -> SyntheticData {
    generate(config).expect("the configuration is valid")
}

fn random_point(rng: &mut ChaCha8Rng, half_extent: f64) -> Vec3 {
    Vec3::from_fn(|_, _| rng.random_range(-half_extent..half_extent))
}

/// Distance to a triangle along a ray, after Möller and Trumbore.
fn intersect_triangle(ray: &Ray, [a, b, c]: [Vec3; 3]) -> Option<f64> {
    let (ab, ac, offset) = (b - a, c - a, ray.origin - a);
    let p = ray.direction.cross(&ac);
    let q = offset.cross(&ab);
    let determinant = ab.dot(&p);
    if ab.cross(&ac).norm() < 1e-12 {
        return None; // three corners of a concave outline can lie on one line
    }
    let u = offset.dot(&p) / determinant;
    let v = ray.direction.dot(&q) / determinant;
    let distance = ac.dot(&q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

/// Where a ray crosses a face: an odd number of the triangles that fan out from
/// the first corner covers a point of the polygon, an even number any other.
fn crossing(face: &PlanarFace, ray: &Ray) -> Option<f64> {
    let hits: Vec<f64> = face.outline[1..]
        .windows(2)
        .filter_map(|side| intersect_triangle(ray, [face.outline[0], side[0], side[1]]))
        .collect();
    (hits.len() % 2 == 1).then(|| hits[0])
}

fn crossings(solid: &Frustum, ray: &Ray) -> Vec<f64> {
    let faces = solid.faces().iter();
    faces.filter_map(|face| crossing(face, ray)).collect()
}

fn inside_by_parity(solid: &Frustum, point: &Vec3) -> bool {
    let ray = Ray {
        origin: *point,
        direction: Vec3::new(0.3, -0.5, 0.8).normalize(),
    };
    crossings(solid, &ray).len() % 2 == 1
}

/// The point of a face that lies `inset` away from the middle of its first side.
fn point_of_face(face: &PlanarFace, inset: f64) -> Vec3 {
    let side = face.outline[1] - face.outline[0];
    face.outline[0] + side / 2.0 + face.normal.cross(&side).normalize() * inset
}

/// Points of the surface, none farther than about `spacing` from the next.
fn surface_samples(solid: &Frustum, spacing: f64) -> Vec<Vec3> {
    let mut samples = Vec::new();
    for face in solid.faces() {
        let u = (face.outline[1] - face.outline[0]).normalize();
        let v = face.normal.cross(&u);
        let steps = (2.0 / spacing) as i32;
        for i in -steps..steps {
            for j in -steps..steps {
                // Shifted unevenly: off the diagonals of the fans.
                let (x, y) = (f64::from(i) + 0.37, f64::from(j) + 0.11);
                let point = face.outline[0] + (u * x + v * y) * spacing;
                let down = Ray {
                    origin: point + face.normal,
                    direction: -face.normal,
                };
                if crossing(face, &down).is_some() {
                    samples.push(point);
                }
            }
        }
    }
    for edge in solid.wireframe().segments() {
        let steps = (edge.length() / spacing).ceil();
        samples.extend((0..=steps as i32).map(|i| edge.point_at(f64::from(i) / steps)));
    }
    samples
}

#[test]
fn solids_are_closed_creased_and_within_their_ball() {
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        let wireframe = solid.wireframe();
        let euler = wireframe.junctions.len() + solid.faces().len() - wireframe.edges.len();
        assert_eq!(euler, 2);
        for junction in &wireframe.junctions {
            assert!(junction.norm() < Solid::BOUNDING_RADIUS);
        }
        for [a, b] in &wireframe.edges {
            let mut forward_normals = Vec::new();
            let mut backward_normals = Vec::new();
            for face in solid.faces() {
                let ends = face.junctions.iter().cycle().skip(1);
                for side in face.junctions.iter().zip(ends) {
                    if side == (a, b) {
                        forward_normals.push(face.normal);
                    } else if side == (b, a) {
                        backward_normals.push(face.normal);
                    }
                }
            }
            assert_eq!((forward_normals.len(), backward_normals.len()), (1, 1));
            let cosine = forward_normals[0].dot(&backward_normals[0]);
            assert!(cosine < 0.95, "a real crease has two planes");
        }
    }
}

#[test]
fn faces_are_flat_and_look_outwards() {
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        for face in solid.faces() {
            assert!((face.normal.norm() - 1.0).abs() < 1e-12);
            for corner in &face.outline {
                assert!(face.plane_distance(corner).abs() < 1e-12);
            }
            let point = point_of_face(face, 1e-3);
            assert!(!inside_by_parity(&solid, &(point + face.normal * 1e-4)));
            assert!(inside_by_parity(&solid, &(point - face.normal * 1e-4)));
        }
    }
}

#[test]
fn sdf_agrees_with_a_densely_sampled_surface_and_with_ray_parity() {
    let spacing = 0.02;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        let samples = surface_samples(&solid, spacing);
        let mut inside_count = 0;
        for _ in 0..200 {
            let point = random_point(&mut rng, 0.6);
            let sdf = solid.sdf(&point);
            let sampled = samples
                .iter()
                .map(|sample| (sample - point).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(sdf.abs() <= sampled + 1e-12, "{sdf} against {sampled}");
            assert!(
                sampled <= sdf.abs() + 1.5 * spacing,
                "{sdf} against {sampled}"
            );
            let inside = inside_by_parity(&solid, &point);
            assert_eq!(sdf < 0.0, inside);
            assert_eq!(solid.contains(&point), inside);
            inside_count += usize::from(inside);
        }
        assert!((10..150).contains(&inside_count), "{inside_count} inside");
    }
}

#[test]
fn the_gradient_is_the_derivative_and_has_unit_length() {
    let h = 1e-6;
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        let mut smooth = 0;
        for _ in 0..500 {
            let point = random_point(&mut rng, 0.8);
            let (sdf, gradient) = solid.sdf_and_gradient(&point);
            assert_eq!(sdf, solid.sdf(&point));
            assert!((gradient.norm() - 1.0).abs() < 1e-9);
            let differences = Vec3::from_fn(|axis, _| {
                let step = Vec3::ith(axis, h);
                (solid.sdf(&(point + step)) - solid.sdf(&(point - step))) / (2.0 * h)
            });
            smooth += usize::from((differences - gradient).norm() < 1e-4);
        }
        assert!(smooth >= 497, "only {smooth} of 500 points are smooth");
    }
}

#[test]
fn sdf_vanishes_on_the_wireframe_and_has_the_normal_on_faces() {
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        for edge in solid.wireframe().segments() {
            for i in 0..=10 {
                assert!(solid.sdf(&edge.point_at(f64::from(i) / 10.0)).abs() < 1e-12);
            }
        }
        for face in solid.faces() {
            let point = point_of_face(face, 0.01);
            for height in [-1e-3, 0.0, 1e-3] {
                let (sdf, gradient) = solid.sdf_and_gradient(&(point + face.normal * height));
                assert!((sdf - height).abs() < 1e-12);
                assert!((gradient - face.normal).norm() < 1e-9);
            }
        }
    }
}

#[test]
fn cameras_surround_the_object_and_look_at_it() {
    let config = SyntheticScene {
        views: 60,
        image_size: 16,
        camera_distance: 2.1,
        ..SyntheticScene::default()
    };
    let cameras: Vec<Camera> = data(&config).scene.views.iter().map(|v| v.camera).collect();
    for (index, camera) in cameras.iter().enumerate() {
        assert!((camera.center_in_world.norm() - 2.1).abs() < 1e-12);
        let rotation = camera.world_from_camera;
        assert!((rotation.determinant() - 1.0).abs() < 1e-12);
        assert!((rotation.transpose() * rotation).is_identity(1e-12));
        let origin = camera.project(&Vec3::zeros());
        assert!((origin.pixel - Vector2::new(8.0, 8.0)).norm() < 1e-9);
        assert!((origin.depth - 2.1).abs() < 1e-12);
        // Sixty equal shares of the sphere are caps of 15 degrees' radius.
        let nearest = cameras
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != index)
            .map(|(_, other)| other.forward().angle(&camera.forward()).to_degrees())
            .fold(f64::INFINITY, f64::min);
        assert!((15.0..45.0).contains(&nearest), "{nearest} degrees");
    }
}

#[test]
fn visible_parts_end_on_projected_edges_or_at_projected_junctions() {
    let mut occluded_ends = 0;
    for solid in Solid::POLYHEDRA {
        let SyntheticData {
            scene,
            truth,
            view_truths,
            ..
        } = data(&perfect(solid));
        for (view, view_truth) in scene.views.iter().zip(&view_truths) {
            let project = |point: &Vec3| view.camera.project(point).pixel;
            let segments = truth.segments();
            let edges: Vec<LineSegment2> = segments.iter().map(|s| s.map(project)).collect();
            for part in &view_truth.visible {
                assert!(part.range[0] < part.range[1]);
                if part.range == [0.0, 1.0] {
                    assert_eq!(part.junctions, truth.edges[part.edge].map(Some));
                }
                for (end, junction) in part.segment.ends().iter().zip(part.junctions) {
                    assert!(edges[part.edge].distance_to_point(end) < 1e-9);
                    if let Some(junction) = junction {
                        assert_eq!(*end, project(&truth.junctions[junction]));
                        continue;
                    }
                    occluded_ends += 1;
                    let to_occluder = (0..edges.len())
                        .filter(|edge| *edge != part.edge)
                        .map(|edge| edges[edge].distance_to_point(end))
                        .fold(f64::INFINITY, f64::min);
                    assert!(to_occluder < 1e-9, "no occluder within {to_occluder} px");
                }
            }
        }
    }
    assert!(occluded_ends > 40, "only {occluded_ends} T-junctions");
}

/// Whether nothing stands between the camera and a point of the surface.
fn visible_by_ray_casting(solid: &Frustum, camera: &Camera, point: &Vec3) -> bool {
    let offset = point - camera.center_in_world;
    let ray = Ray {
        origin: camera.center_in_world,
        direction: offset.normalize(),
    };
    crossings(solid, &ray)
        .iter()
        .all(|distance| *distance > offset.norm() - 1e-6)
}

#[test]
fn occlusion_agrees_with_ray_casting_along_every_edge() {
    for kind in Solid::POLYHEDRA {
        let (mut seen, mut hidden) = (0, 0);
        let SyntheticData { scene, solid, .. } = data(&small(kind));
        for view in &scene.views {
            let parts = visible_parts(&solid, &view.camera);
            for (edge, segment) in solid.wireframe().segments().iter().enumerate() {
                let ranges: Vec<[f64; 2]> = parts
                    .iter()
                    .filter(|part| part.edge == edge)
                    .map(|part| part.range)
                    .collect();
                for i in 0..100 {
                    let t = (f64::from(i) + 0.5) / 100.0;
                    if ranges.iter().flatten().any(|end| (end - t).abs() < 1e-4) {
                        continue;
                    }
                    let exact = ranges.iter().any(|[a, b]| (*a..=*b).contains(&t));
                    let cast = visible_by_ray_casting(&solid, &view.camera, &segment.point_at(t));
                    assert_eq!(exact, cast, "{} edge {edge} at {t}", kind.name());
                    seen += usize::from(exact);
                    hidden += usize::from(!exact);
                }
            }
        }
        assert!(seen > 1000 && hidden > 1000, "{seen} seen, {hidden} hidden");
    }
}

#[test]
fn images_agree_with_ray_casting_at_random_pixels() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for kind in Solid::POLYHEDRA {
        let SyntheticData { scene, solid, .. } = data(&small(kind));
        let (mut empty, mut covered) = (0, 0);
        for view in &scene.views {
            for _ in 0..200 {
                let (x, y) = (rng.random_range(0..128), rng.random_range(0..128));
                let hits = [(0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)]
                    .map(|(dx, dy)| Vector2::new(f64::from(x) + dx, f64::from(y) + dy))
                    .iter()
                    .filter(|sample| {
                        !crossings(&solid, &view.camera.ray_through(sample)).is_empty()
                    })
                    .count();
                let brightness = view
                    .image
                    .pixel(x, y)
                    .unwrap()
                    .0
                    .into_iter()
                    .max()
                    .unwrap_or(0);
                match hits {
                    0 => assert_eq!(brightness, 0),
                    4 => assert!(f64::from(brightness) / 255.0 > 0.2),
                    _ => assert!(brightness > 0),
                }
                empty += usize::from(hits == 0);
                covered += usize::from(hits == 4);
            }
        }
        assert!(
            empty > 100 && covered > 100,
            "{empty} empty, {covered} covered"
        );
    }
}

/// The colour that a face shows to a camera close in front of it.
fn color_of_face(solid: &Frustum, face: &PlanarFace, shading: bool) -> Vec3 {
    let right = -(face.outline[1] - face.outline[0]).normalize();
    let forward = -face.normal;
    let camera = Camera {
        intrinsics: Intrinsics {
            fx: 16.0,
            fy: 16.0,
            cx: 8.0,
            cy: 8.0,
            skew: 0.0,
        },
        center_in_world: point_of_face(face, 0.05) + face.normal * 0.05,
        world_from_camera: Matrix3::from_columns(&[right, forward.cross(&right), forward]),
        width: 16,
        height: 16,
    };
    let pixel = render(solid, &camera, shading).get_pixel(8, 8).0;
    Vec3::from(pixel.map(f64::from)) / 255.0
}

#[test]
fn neighbouring_faces_differ_visibly() {
    for solid in Solid::POLYHEDRA.map(Solid::frustum) {
        for shading in [true, false] {
            let colors: Vec<Vec3> = solid
                .faces()
                .iter()
                .map(|face| color_of_face(&solid, face, shading))
                .collect();
            for edge in &solid.wireframe().edges {
                let sides: Vec<usize> = (0..solid.faces().len())
                    .filter(|face| solid.faces()[*face].contains_edge(edge))
                    .collect();
                let contrast = (colors[sides[0]] - colors[sides[1]]).amax();
                assert!(contrast > 0.1, "faces {sides:?} differ by {contrast}");
            }
        }
    }
}

#[test]
fn a_perfect_detector_draws_the_visible_parts_and_shares_junctions() {
    for kind in Solid::POLYHEDRA {
        let SyntheticData {
            scene, view_truths, ..
        } = data(&perfect(kind));
        for (view, truth) in scene.views.iter().zip(&view_truths) {
            let wireframe = &view.wireframe;
            let expected: Vec<_> = (0..truth.visible.len()).map(Some).collect();
            assert_eq!(truth.sources, expected);
            for (part, [a, b]) in truth.visible.iter().zip(&wireframe.edges) {
                assert_eq!(part.segment.start, wireframe.vertices[*a]);
                assert_eq!(part.segment.end, wireframe.vertices[*b]);
            }
            let mut junctions: Vec<usize> = truth
                .visible
                .iter()
                .flat_map(|part| part.junctions)
                .flatten()
                .collect();
            let cut_off = 2 * truth.visible.len() - junctions.len();
            junctions.sort_unstable();
            junctions.dedup();
            assert_eq!(wireframe.vertices.len(), junctions.len() + cut_off);
        }
    }
}

#[test]
fn detections_have_the_configured_statistics() {
    let config = SyntheticScene {
        views: 300,
        noise_in_pixels: 0.7,
        detection_rate: 0.6,
        false_segments: 3,
        min_visible_length: 10.0,
        ..small(Solid::UPrism)
    };
    let SyntheticData {
        scene, view_truths, ..
    } = data(&config);
    let (mut part_count, mut detected_count) = (0.0, 0.0);
    let mut noise = Vec::new();
    let (mut true_scores, mut false_scores) = (Vec::new(), Vec::new());
    for (view, truth) in scene.views.iter().zip(&view_truths) {
        let wireframe = &view.wireframe;
        assert_eq!(wireframe.edges.len(), truth.sources.len());
        assert_eq!(wireframe.edges.len(), wireframe.edge_scores.len());
        assert_eq!(wireframe.vertices.len(), wireframe.vertex_scores.len());
        assert_eq!((wireframe.width, wireframe.height), view.image.dimensions());
        assert_eq!(truth.sources.iter().filter(|s| s.is_none()).count(), 3);
        assert!(truth.visible.iter().all(|p| p.segment.length() >= 10.0));
        let mut scores = wireframe.edge_scores.iter().chain(&wireframe.vertex_scores);
        assert!(scores.all(|score| *score > 0.05 && *score <= 1.0));

        part_count += truth.visible.len() as f64;
        let mut counted = vec![false; wireframe.vertices.len()];
        for (edge, source) in truth.sources.iter().enumerate() {
            let score = wireframe.edge_scores[edge];
            let Some(source) = source else {
                false_scores.push(score);
                continue;
            };
            true_scores.push(score);
            detected_count += 1.0;
            let exact = truth.visible[*source].segment.ends();
            for (vertex, exact) in wireframe.edges[edge].iter().zip(exact) {
                if !std::mem::replace(&mut counted[*vertex], true) {
                    let error = wireframe.vertices[*vertex] - exact;
                    noise.extend([error.x, error.y]);
                }
            }
        }
    }
    // Each within four standard errors.
    let count = noise.len() as f64;
    let mean = noise.iter().sum::<f64>() / count;
    assert!(mean.abs() < 4.0 * 0.7 / count.sqrt(), "mean {mean}");
    let sigma = (noise.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let sigma_error = 0.7 / (2.0 * count).sqrt();
    assert!((sigma - 0.7).abs() < 4.0 * sigma_error, "sigma {sigma}");
    let rate: f64 = detected_count / part_count;
    let rate_error = (0.6 * 0.4 / part_count).sqrt();
    assert!((rate - 0.6).abs() < 4.0 * rate_error, "rate {rate}");
    for scores in [&mut true_scores, &mut false_scores] {
        scores.sort_by(f64::total_cmp);
    }
    assert!(true_scores[true_scores.len() / 2] > 0.9);
    assert!(false_scores[false_scores.len() / 2] < 0.2);
}

fn assert_scenes_equal(a: &SyntheticData, b: &SyntheticData) {
    assert_eq!(a.view_truths, b.view_truths);
    assert_eq!(a.scene.views.len(), b.scene.views.len());
    for (a, b) in a.scene.views.iter().zip(&b.scene.views) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.camera, b.camera);
        assert_eq!(a.wireframe, b.wireframe);
        let same = a.image.read().unwrap() == b.image.read().unwrap();
        assert!(same, "the images of {} differ", a.name);
    }
}

#[test]
fn the_same_configuration_gives_the_same_scene_on_any_number_of_threads() {
    let config = small(Solid::TPrism);
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads are available");
        pool.install(|| data(&config))
    };
    let one = on_threads(1);
    assert_scenes_equal(&one, &on_threads(3));

    let other = data(&SyntheticScene { seed: 1, ..config });
    let (a, b) = (&one.scene.views[0], &other.scene.views[0]);
    assert_ne!(a.camera, b.camera);
    assert_ne!(a.wireframe, b.wireframe);
}

#[test]
fn images_on_demand_are_the_same() {
    let config = SyntheticScene {
        views: 3,
        ..small(Solid::LPrism)
    };
    let later = generate_on_demand(&config).unwrap();
    assert_scenes_equal(&later, &data(&config));
}

#[test]
fn images_need_not_be_square() {
    let square = SyntheticScene {
        camera_distance: 4.0,
        ..small(Solid::LPrism)
    };
    let flat = SyntheticScene {
        image_height: Some(96),
        ..square.clone()
    };
    let (square, flat) = (data(&square), data(&flat));
    flat.scene.validate().unwrap();
    for (square, flat) in square.scene.views.iter().zip(&flat.scene.views) {
        assert_eq!(flat.image.dimensions(), (128, 96));
        // The same picture without its uppermost and lowest rows.
        let (square, flat) = (square.image.read().unwrap(), flat.image.read().unwrap());
        for (x, y, rgb) in flat.enumerate_pixels() {
            assert_eq!(rgb, square.get_pixel(x, y + 16));
        }
    }
    // Too near for its height alone.
    let config = SyntheticScene {
        image_height: Some(16),
        ..small(Solid::LPrism)
    };
    assert_eq!(generate(&config).unwrap_err().field, "camera_distance");
}

#[test]
fn impossible_configurations_are_named() {
    type Change = fn(&mut SyntheticScene);
    let cases: [(&str, Change); 8] = [
        ("views", |c| c.views = 0),
        ("image_size", |c| c.image_size = 0),
        ("image_height", |c| c.image_height = Some(9000)),
        ("camera_distance", |c| c.camera_distance = 0.5),
        ("noise_in_pixels", |c| c.noise_in_pixels = f64::NAN),
        ("detection_rate", |c| c.detection_rate = 1.5),
        ("false_segments", |c| c.false_segments = usize::MAX),
        ("min_visible_length", |c| c.min_visible_length = -1.0),
    ];
    for (field, change) in cases {
        let mut config = SyntheticScene::default();
        change(&mut config);
        let error = generate(&config).expect_err(field);
        assert_eq!(error.field, field);
        assert!(error.to_string().contains(field));
    }
}

#[test]
fn configurations_name_solids_in_kebab_case_and_refuse_unknown_fields() {
    for solid in Solid::POLYHEDRA {
        let json = format!(r#"{{"solid": "{}", "views": 7}}"#, solid.name());
        let config: SyntheticScene = serde_json::from_str(&json).expect("the name is known");
        assert_eq!((config.solid, config.views), (solid, 7));
    }
    let misspelt = serde_json::from_str::<SyntheticScene>(r#"{"veiws": 7}"#);
    assert!(misspelt.is_err_and(|error| error.to_string().contains("veiws")));
}

#[test]
fn a_scene_survives_the_disk() {
    let scene = data(&small(Solid::StairPrism)).scene;
    let dir = tempfile::tempdir().expect("a temporary folder");
    write_scene(&scene, dir.path()).expect("the scene is written");
    let loaded = load_scene(dir.path(), &LoadOptions::default()).expect("the scene is read");
    assert_eq!(loaded.warnings, []);
    let loaded = loaded.scene;
    assert_eq!(loaded.original_from_world, Similarity::identity());
    assert_eq!(loaded.pixel_center, scene.pixel_center);
    assert_eq!(loaded.views.len(), scene.views.len());
    for (a, b) in scene.views.iter().zip(&loaded.views) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.camera, b.camera);
        let same = a.image.read().unwrap() == b.image.read().unwrap();
        assert!(same, "the images of {} differ", a.name);
        assert_eq!(a.wireframe.edges, b.wireframe.edges);
        assert_eq!(a.wireframe.edge_scores, b.wireframe.edge_scores);
        assert_eq!(a.wireframe.vertex_scores, b.wireframe.vertex_scores);
        // The file counts pixel centres as integers: half a pixel goes and
        // comes back, which rounds.
        for (a, b) in a.wireframe.vertices.iter().zip(&b.wireframe.vertices) {
            assert!((a - b).norm() < 1e-12);
        }
    }
}
