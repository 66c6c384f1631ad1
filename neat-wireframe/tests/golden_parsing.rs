//! The paper's back end against the published final parsing (golden case 11).
//!
//! Cases b and c also take the cameras and HAWP wireframes of the toy scene, which
//! lie in `tests/data/toy`.

mod golden;

use golden::{Geometry, Golden, repository};
use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment3, hawp_json};
use neat_wireframe::paper::{
    AttractionConfig, JunctionVotingConfig, NeatLine, NeatLineConfig, PaperBackEndConfig,
    SupportedSegment, VisibilityConfig, attract, attracted_ends, neat_lines, refine_junctions,
    seeing_views, squared_reprojection_distance, vote_for_junctions,
};
use neat_wireframe::{SignedDistance, ViewObservation};

/// What the published code computes in float32 (9e-8 measured).
const POSITION_TOLERANCE: f64 = 2e-6;

fn golden() -> Golden {
    Golden::open("11_final_parsing")
}

/// The largest difference of two lists of segments, end by end.
fn largest_difference(a: &[LineSegment3], b: &[LineSegment3]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .flat_map(|(a, b)| a.end_distances(b))
        .fold(0.0, f64::max)
}

/// All 100 views of the toy scene, integer pixel centres as in the published
/// code.
fn toy_views(min_score: f64) -> Vec<ViewObservation> {
    let dir = repository().join("tests/data/toy");
    let text = std::fs::read_to_string(dir.join("cameras.json")).unwrap();
    let cameras: serde_json::Value = serde_json::from_str(&text).unwrap();
    let view = |(index, frame): (usize, &serde_json::Value)| {
        let number =
            |key: &str, row: usize, column: usize| frame[key][row][column].as_f64().unwrap();
        let wireframe =
            hawp_json::read(&dir.join(format!("hawp/image_{index:04}.json")), 0.0).unwrap();
        ViewObservation {
            camera: Camera {
                intrinsics: Intrinsics::from_matrix(&Matrix3::from_fn(|r, c| number("K", r, c))),
                world_from_camera: Matrix3::from_fn(|r, c| number("c2w", r, c)),
                center_in_world: Vector3::from_fn(|r, _| number("c2w", r, 3)),
                width: wireframe.width,
                height: wireframe.height,
            },
            segments: wireframe.segments(min_score),
            junctions: wireframe.vertices.clone(),
        }
    };
    let frames = cameras["frames"].as_array().unwrap();
    frames.iter().enumerate().map(view).collect()
}

/// The upper triangle of a symmetric 0/1 matrix, with the diagonal.
fn edges_of_graph(graph: &[f64], size: usize) -> Vec<[usize; 2]> {
    (0..size)
        .flat_map(|i| (i..size).map(move |j| [i, j]))
        .filter(|[i, j]| graph[i * size + j] != 0.0)
        .collect()
}

const PUBLISHED_ATTRACTION: AttractionConfig = AttractionConfig {
    exclude_self_loops: false,
};

#[test]
fn case_a_attraction() {
    let golden = golden();
    let lines = golden.segments("a/segments");
    let junctions = golden.points("a/junctions");
    let matched: Vec<usize> = lines
        .iter()
        .map(|line| usize::from(attracted_ends(line, &junctions).is_some()))
        .collect();
    assert_eq!(matched, golden.indices("a/is_matched"));

    let edges = attract(&lines, &junctions, &PUBLISHED_ATTRACTION);
    assert_eq!(edges, golden.index_rows("a/edges"));
    assert_eq!(
        edges,
        edges_of_graph(&golden.numbers("a/graph"), junctions.len())
    );

    let proper = attract(&lines, &junctions, &AttractionConfig::default());
    assert_eq!(edges.len() - proper.len(), 9, "self loops");
    assert!(proper.iter().all(|[a, b]| a < b));
}

#[test]
fn case_b_visibility() {
    let golden = golden();
    let config = VisibilityConfig::default();
    let views = toy_views(config.min_segment_score);
    let segments = golden.segments("b/segments");
    let seen = seeing_views(&segments, &views, &config);
    assert_eq!(seen, golden.indices("b/visible_views"));
    let strict = VisibilityConfig {
        max_squared_distance: 25.0,
        ..config
    };
    assert_eq!(
        seeing_views(&segments, &views, &strict),
        golden.indices("b/visible_views_th25")
    );

    let expected = golden.numbers("b/min_sq_dist");
    let bits = golden.numbers("b/visibility");
    for (s, segment) in segments.iter().enumerate() {
        for (v, view) in views.iter().enumerate() {
            let distance = squared_reprojection_distance(segment, view, config.min_segment_score);
            let expected = expected[s * views.len() + v];
            // Projections in float32 are good to about 1e-4 px.
            let in_pixels = (distance.sqrt() - expected.sqrt()).abs();
            assert!(in_pixels < 1e-3, "{distance} {expected}");
            let byte = bits[s * views.len().div_ceil(8) + v / 8] as u8;
            let visible = byte >> (7 - v % 8) & 1 == 1;
            assert_eq!(distance < config.max_squared_distance, visible);
        }
    }
    let survivors: Vec<LineSegment3> = segments
        .into_iter()
        .zip(seen)
        .filter(|(_, seen)| *seen >= config.min_views)
        .map(|(segment, _)| segment)
        .collect();
    assert_eq!(survivors, golden.segments("b/survivors"));
}

/// The synthetic "network" of case c.
struct Plane {
    normal: Vector3<f64>,
}

impl SignedDistance for Plane {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points
            .iter()
            .map(|p| 0.5 * p.dot(&self.normal) - 0.03)
            .collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        let gradient = 0.5 * self.normal;
        self.sdf(points)
            .into_iter()
            .map(|sdf| (sdf, gradient))
            .collect()
    }
}

/// The inputs of case c: 12 of the 100 views and their rays.
struct CaseC {
    golden: Golden,
    all_views: Vec<ViewObservation>,
    /// The views that were queried, in the order of the run.
    queried: Vec<usize>,
    /// Per queried view.
    rays: Vec<Vec<SupportedSegment>>,
}

impl CaseC {
    fn read() -> Self {
        let golden = golden();
        let all_views = toy_views(NeatLineConfig::default().min_segment_score);
        let queried = golden.indices("c/views");
        let view_of_ray = golden.indices("c/ray_view");
        let segments = golden.segments("c/ray_lines3d");
        let support_points = golden.points("c/ray_support_point");
        let rays_of = |view: &usize| {
            (0..view_of_ray.len())
                .filter(|ray| view_of_ray[*ray] == *view)
                .map(|ray| SupportedSegment {
                    segment: segments[ray],
                    support_point: support_points[ray],
                })
                .collect()
        };
        let rays = queried.iter().map(rays_of).collect();
        Self {
            golden,
            all_views,
            queried,
            rays,
        }
    }

    fn surface(&self) -> Plane {
        Plane {
            normal: self.golden.points("c/plane_normal")[0],
        }
    }

    fn queried_views(&self) -> Vec<ViewObservation> {
        self.queried
            .iter()
            .map(|v| self.all_views[*v].clone())
            .collect()
    }

    fn refined(&self) -> Vec<Vector3<f64>> {
        let junctions = self.golden.points("c/latents");
        refine_junctions(&junctions, &self.surface(), &Default::default())
            .unwrap()
            .into_iter()
            .map(|junction| junction.position)
            .collect()
    }

    fn lines(&self, config: &NeatLineConfig) -> Vec<Vec<NeatLine>> {
        self.queried_views()
            .iter()
            .zip(&self.rays)
            .map(|(view, rays)| neat_lines(view, rays, config))
            .collect()
    }
}

const PUBLISHED_LINES: NeatLineConfig = NeatLineConfig {
    min_segment_score: 0.01,
    max_squared_reprojection: 10.0,
    max_support_distance: 0.01,
    published_cross_product: true,
};

#[test]
fn case_c_junction_refinement() {
    let golden = golden();
    let surface = Plane {
        normal: golden.points("c/plane_normal")[0],
    };
    let junctions = golden.points("c/latents");
    let mut config = Default::default();
    let refined = refine_junctions(&junctions, &surface, &config).unwrap();
    let expected = golden.points("c/refined_junctions");
    assert_eq!(refined.len(), expected.len());
    for (refined, expected) in refined.iter().zip(expected) {
        assert!((refined.position - expected).norm() < POSITION_TOLERANCE);
    }
    // The paper's rejection, which the published code does not apply: it would
    // have removed 26 of the 32.
    config.max_abs_sdf = Some(0.05);
    let close = refine_junctions(&junctions, &surface, &config).unwrap();
    assert_eq!(close.len(), 6);
}

#[test]
fn case_c_neat_lines() {
    let case = CaseC::read();
    let published: Vec<NeatLine> = case.lines(&PUBLISHED_LINES).concat();
    let ours: Vec<NeatLine> = case.lines(&NeatLineConfig::default()).concat();

    let origin: Vec<[usize; 2]> = case
        .lines(&PUBLISHED_LINES)
        .iter()
        .zip(&case.queried)
        .flat_map(|(lines, view)| lines.iter().map(|line| [*view, line.segment_in_view]))
        .collect();
    assert_eq!(origin, case.golden.index_rows("c/raw_view_and_segment"));
    let rays: Vec<usize> = published.iter().map(|line| line.rays).collect();
    assert_eq!(rays, case.golden.indices("c/raw_support"));

    let segments: Vec<LineSegment3> = published.iter().map(|line| line.segment).collect();
    let expected = case.golden.segments("c/raw_lines3d");
    assert!(largest_difference(&segments, &expected) < POSITION_TOLERANCE);
    for (lines, name) in [
        (&published, "c/raw_scores"),
        (&ours, "c/raw_scores_correct_cross"),
    ] {
        for (line, expected) in lines.iter().zip(case.golden.numbers(name)) {
            assert!((line.support_distance - expected).abs() < POSITION_TOLERANCE);
        }
    }

    let supported: Vec<LineSegment3> = published
        .iter()
        .filter(|line| line.is_supported(&PUBLISHED_LINES))
        .map(|line| line.segment)
        .collect();
    let expected = case.golden.segments("c/lines3d_all");
    assert!(largest_difference(&supported, &expected) < POSITION_TOLERANCE);

    let flipped = published
        .iter()
        .zip(&ours)
        .filter(|(a, b)| a.is_supported(&PUBLISHED_LINES) != b.is_supported(&PUBLISHED_LINES))
        .count();
    assert_eq!(flipped, 9, "decisions that the cross product changes");
}

#[test]
fn case_c_junction_voting() {
    let case = CaseC::read();
    let config = JunctionVotingConfig::default();
    let refined = case.refined();
    let votes = vote_for_junctions(&refined, &case.lines(&PUBLISHED_LINES), &config).unwrap();
    let junctions: Vec<usize> = votes.iter().map(|v| v.junction).collect();
    let counts: Vec<usize> = votes.iter().map(|v| v.votes).collect();
    assert_eq!(junctions, case.golden.indices("c/vote_junction"));
    assert_eq!(counts, case.golden.indices("c/vote_count"));

    let kept: Vec<Vector3<f64>> = votes
        .iter()
        .filter(|v| v.votes >= config.min_votes)
        .map(|v| refined[v.junction])
        .collect();
    let expected = case.golden.points("c/junctions3d_initial");
    assert_eq!(kept.len(), expected.len());
    for (kept, expected) in kept.iter().zip(expected) {
        assert!((kept - expected).norm() < POSITION_TOLERANCE);
    }
}

#[test]
fn case_c_attraction_and_visibility() {
    let case = CaseC::read();
    let lines = case.golden.segments("c/lines3d_all");
    let junctions = case.golden.points("c/junctions3d_initial");
    let edges = attract(&lines, &junctions, &PUBLISHED_ATTRACTION);
    let graph = case.golden.numbers("c/graph_initial");
    assert_eq!(edges, edges_of_graph(&graph, junctions.len()));

    let segments: Vec<LineSegment3> = edges
        .iter()
        .map(|[a, b]| LineSegment3::new(junctions[*a], junctions[*b]))
        .collect();
    assert_eq!(segments, case.golden.segments("c/lines3d_wfi"));
    let config = VisibilityConfig::default();
    for (views, name) in [(&case.queried_views(), "12"), (&case.all_views, "100")] {
        let seen = seeing_views(&segments, views, &config);
        assert_eq!(
            seen,
            case.golden
                .indices(&format!("c/wfi_visible_views_of_{name}"))
        );
        let checked: Vec<LineSegment3> = segments
            .iter()
            .zip(&seen)
            .filter(|(_, seen)| **seen >= config.min_views)
            .map(|(segment, _)| *segment)
            .collect();
        let expected = case.golden.segments(&format!("c/wfi_checked_{name}views"));
        assert_eq!(checked, expected);
    }
}

/// End to end; the order of junctions and edges is ours, so compare as sets.
#[test]
fn case_c_whole_back_end() {
    let case = CaseC::read();
    // Lines come from the 12 queried views only, all 100 check visibility.
    let mut rays_of_all = vec![Vec::new(); case.all_views.len()];
    for (view, rays) in case.queried.iter().zip(&case.rays) {
        rays_of_all[*view] = rays.clone();
    }
    for (views, rays, name) in [
        (&case.queried_views(), &case.rays, "12"),
        (&case.all_views, &rays_of_all, "100"),
    ] {
        let result = PaperBackEndConfig::published()
            .run(
                &case.golden.points("c/latents"),
                views,
                rays,
                &case.surface(),
            )
            .unwrap();
        let expected = case.golden.segments(&format!("c/wfi_checked_{name}views"));
        let found = result.wireframe.segments();
        assert_eq!(found.len(), expected.len());
        for segment in &expected {
            let matches = found
                .iter()
                .filter(|s| s.unordered_squared_end_distance(segment) < POSITION_TOLERANCE.powi(2))
                .count();
            assert_eq!(matches, 1);
        }
        let counts = result.counts;
        assert_eq!(counts.rays, 2884);
        assert_eq!((counts.lines, counts.supported_lines), (107, 39));
        assert_eq!((counts.junctions, counts.refined_junctions), (32, 32));
        assert_eq!((counts.voted_junctions, counts.kept_junctions), (12, 12));
        assert_eq!(
            (counts.attracted_edges, counts.visible_edges),
            (16, expected.len())
        );
        assert!(result.wireframe.edges.is_sorted());
    }
}

#[test]
fn any_number_of_threads_gives_the_same_wireframe() {
    let case = CaseC::read();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            PaperBackEndConfig::default()
                .run(
                    &case.golden.points("c/latents"),
                    &case.queried_views(),
                    &case.rays,
                    &case.surface(),
                )
                .unwrap()
        })
    };
    assert_eq!(run(1), run(5));
}
