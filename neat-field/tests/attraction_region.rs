//! Attraction regions against the published code and against all pairs.

#[path = "../../tests/data/golden/reader.rs"]
mod golden;

use golden::Golden;
use nalgebra::Vector2;
use neat_core::LineSegment2;
use neat_core::synthetic::{SyntheticScene, generate};
use neat_field::attraction_region::AttractionRegions;
use neat_field::region_pixels::RegionPixels;
use proptest::prelude::*;

const CASE: &str = "09_attraction_regions";
/// Accepted by the golden README; float32 in the published code.
const FOOT_TOLERANCE_PX: f64 = 5e-4;

fn segments(golden: &Golden, name: &str) -> Vec<LineSegment2> {
    let to_segment = |[x1, y1, x2, y2, _score]: [f64; 5]| {
        LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2))
    };
    golden.rows(name).into_iter().map(to_segment).collect()
}

fn indices(golden: &Golden, name: &str) -> Vec<u32> {
    golden.numbers(name).iter().map(|&n| n as u32).collect()
}

#[test]
fn real_views_have_the_published_masks_labels_and_feet() {
    let golden = Golden::open(CASE);
    for view in ["view000", "view033", "view071"] {
        let segments = segments(&golden, &format!("{view}.segments"));
        let ambiguous = indices(&golden, &format!("{view}.ambiguous_pixel"));
        let regions = AttractionRegions::compute(&segments, 512, 512, 0.0, 10.0);

        for threshold in [1, 5, 10] {
            let bits = indices(&golden, &format!("{view}.mask{threshold}.packbits"));
            let is_foreground = |pixel: &u32| bits[*pixel as usize / 8] >> (7 - pixel % 8) & 1 == 1;
            let unambiguous = |pixel: &u32| !ambiguous.contains(pixel);
            let expected: Vec<u32> = (0..512 * 512)
                .filter(is_foreground)
                .filter(unambiguous)
                .collect();
            let mut pixels = regions.thin(f64::from(threshold)).pixels;
            pixels.retain(unambiguous);
            assert_eq!(pixels, expected, "{view} at {threshold} px");
        }

        let pixels = indices(&golden, &format!("{view}.fg10.pixel"));
        let labels = indices(&golden, &format!("{view}.fg10.label"));
        let feet = golden.rows::<2>(&format!("{view}.fg10.foot"));
        for ((pixel, label), foot) in pixels.iter().zip(labels).zip(feet) {
            if ambiguous.contains(pixel) {
                continue;
            }
            let i = regions.pixels.binary_search(pixel).unwrap();
            assert_eq!(regions.labels[i], label, "{view}, pixel {pixel}");
            assert_foot(regions.feet[i], foot);
        }
    }
}

#[test]
fn the_synthetic_image_has_the_published_field() {
    let golden = Golden::open(CASE);
    let (width, height, threshold) = (48, 40, 5.0);
    let segments = segments(&golden, "synthetic.segments");
    let regions = AttractionRegions::compute(&segments, width, height, 0.0, threshold);

    let mask = golden.numbers("synthetic.mask5");
    let expected: Vec<u32> = (0..width * height)
        .filter(|&pixel| mask[pixel as usize] == 1.0)
        .collect();
    assert_eq!(regions.pixels, expected);

    let labels = indices(&golden, "synthetic.nearest");
    let parameters = golden.numbers("synthetic.t");
    let feet = golden.rows::<2>("synthetic.foot");
    let offsets = golden.numbers("synthetic.offset");
    for (i, &pixel) in regions.pixels.iter().enumerate() {
        let pixel = pixel as usize;
        let plane = (width * height) as usize;
        let distance = offsets[pixel].hypot(offsets[plane + pixel]);
        assert_eq!(regions.labels[i], labels[pixel]);
        assert_foot(regions.feet[i], feet[pixel]);
        assert!((f64::from(regions.parameters[i]) - parameters[pixel]).abs() < 1e-5);
        assert!((f64::from(regions.distances[i]) - distance).abs() < 1e-5);
    }
    assert!(regions.labels.contains(&4), "a point attracts like a disc");
    assert!(!regions.labels.contains(&3), "the first of equals attracts");
}

fn assert_foot(actual: [f32; 2], expected: [f64; 2]) {
    for axis in 0..2 {
        let error = (f64::from(actual[axis]) - expected[axis]).abs();
        assert!(
            error < FOOT_TOLERANCE_PX,
            "{actual:?}, expected {expected:?}"
        );
    }
}

/// The definition: every pixel asks every segment.
fn all_pairs(
    segments: &[LineSegment2],
    width: u32,
    height: u32,
    pixel_center: f64,
    threshold: f64,
) -> AttractionRegions {
    let mut regions = AttractionRegions::default();
    for pixel in 0..width * height {
        let x = f64::from(pixel % width) + pixel_center;
        let y = f64::from(pixel / width) + pixel_center;
        let mut nearest = (f32::INFINITY, f32::NAN, 0, [0.0; 2]);
        for (label, segment) in (0..).zip(segments) {
            let (a, d) = (segment.start, segment.end - segment.start);
            let t = ((x - a.x) * d.x + (y - a.y) * d.y) / (d.norm_squared() + 1e-6);
            let t = t as f32;
            let c = f64::from(t.clamp(0.0, 1.0));
            let offset = [a.x + c * d.x - x, a.y + c * d.y - y];
            let squared_distance = (offset[0] * offset[0] + offset[1] * offset[1]) as f32;
            if squared_distance < nearest.0 {
                nearest = (squared_distance, t, label, offset);
            }
        }
        let (squared_distance, t, label, offset) = nearest;
        let distance = squared_distance.sqrt();
        if f64::from(distance) <= threshold && (0.0..=1.0).contains(&t) {
            regions.pixels.push(pixel);
            regions.labels.push(label);
            regions
                .feet
                .push([(offset[0] + x) as f32, (offset[1] + y) as f32]);
            regions.distances.push(distance);
            regions.parameters.push(t);
        }
    }
    regions
}

/// Coordinates in and around a 40×30 image: any, and whole ones, which bring
/// axis-aligned, coincident and empty segments and exact ties.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![-30.0..70.0, (-4i32..12).prop_map(|i| f64::from(i) * 4.0)]
}

fn any_segment() -> impl Strategy<Value = LineSegment2> {
    [coordinate(), coordinate(), coordinate(), coordinate()]
        .prop_map(|[x1, y1, x2, y2]| LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..Default::default() })]

    #[test]
    fn strips_agree_with_all_pairs(
        segments in prop::collection::vec(any_segment(), 0..12),
        pixel_center in prop_oneof![Just(0.0), Just(0.5)],
        threshold in prop_oneof![Just(1.0), Just(4.0), Just(10.0), 0.0..15.0],
        thinner in 0.0..15.0,
    ) {
        let regions = AttractionRegions::compute(&segments, 40, 30, pixel_center, threshold);
        let pixels = RegionPixels::compute(&segments, 40, 30, pixel_center, threshold);
        let drawn: Vec<_> = (0..pixels.len()).map(|index| pixels.get(index)).collect();
        let listed = regions.pixels.iter().copied().zip(regions.labels.iter().copied());
        prop_assert_eq!(drawn, listed.collect::<Vec<_>>());
        let expected = all_pairs(&segments, 40, 30, pixel_center, threshold);
        prop_assert_eq!(&regions, &expected);

        let thin = all_pairs(&segments, 40, 30, pixel_center, threshold.min(thinner));
        prop_assert_eq!(regions.thin(thinner), thin);
    }
}

#[test]
fn what_is_not_a_number_attracts_nothing() {
    let good = LineSegment2::new(Vector2::new(2.0, 2.0), Vector2::new(6.0, 2.0));
    let expected = AttractionRegions::compute(&[good], 9, 9, 0.0, 2.0);
    assert!(!expected.is_empty());
    for bad in [f64::NAN, f64::INFINITY] {
        let bad = LineSegment2::new(Vector2::new(bad, 2.0), Vector2::new(6.0, 2.0));
        let regions = AttractionRegions::compute(&[good, bad], 9, 9, 0.0, 2.0);
        assert_eq!(regions, expected);
    }
    for threshold in [f64::NAN, -1.0] {
        assert!(AttractionRegions::compute(&[good], 9, 9, 0.0, threshold).is_empty());
    }
    assert!(AttractionRegions::compute(&[good], 0, 9, 0.0, 2.0).is_empty());
}

#[test]
fn huge_segments_and_thresholds_stay_inside_the_image() {
    let long = LineSegment2::new(Vector2::new(-1e12, -1e12), Vector2::new(1e12, 1e12));
    let regions = AttractionRegions::compute(&[long], 7, 5, 0.0, f64::INFINITY);
    assert_eq!(regions.pixels, (0..35).collect::<Vec<u32>>());
}

#[test]
fn the_regions_of_a_scene_are_those_of_its_views() {
    let config = SyntheticScene {
        views: 4,
        image_size: 64,
        ..SyntheticScene::default()
    };
    let scene = generate(&config).unwrap().scene;
    let min_score = 0.05;
    let expected: Vec<RegionPixels> = scene
        .views
        .iter()
        .map(|view| {
            let scored = view.wireframe.segments(min_score);
            let segments: Vec<LineSegment2> = scored.iter().map(|s| s.segment).collect();
            RegionPixels::compute(&segments, 64, 64, scene.pixel_center, 5.0)
        })
        .collect();
    assert!(expected.iter().all(|regions| !regions.is_empty()));
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let regions = pool
            .build()
            .unwrap()
            .install(|| RegionPixels::of_scene(&scene, min_score, 5.0));
        assert_eq!(regions, expected);
    }
}
