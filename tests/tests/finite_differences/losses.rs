//! The losses of the field and of the junctions.

use burn::tensor::Tensor;
use neat_field::segment_loss::{SegmentLoss, SegmentLossConfig, segment_loss};
use neat_gjp::junction_loss::{MatchedJunctions, junction_loss};
use neat_sdf::losses::{eikonal_loss, mask_loss, rgb_loss};
use neat_tensor::cameras::{RayCameras, project_calibrated};
use neat_tests::finite_differences::{assert_differentiates, constant, normal};
use neat_tests::tensors::numbers;

const RAYS: usize = 5;

/// Identity rotations, centres 3 behind the origin, focal length 500.
fn cameras() -> RayCameras {
    let rows = |row: &[f64]| constant(row.repeat(RAYS), [RAYS, row.len()]);
    RayCameras {
        camera_from_world: rows(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        center: rows(&[0.1, -0.2, -3.0]),
        focal: rows(&[500.0, 480.0, 2.0]),
    }
}

const CONFIG: SegmentLossConfig = SegmentLossConfig {
    cutoff_in_pixels: 100.0,
    min_opacity: Some(0.5),
    mean_over_all_rays: false,
};

/// Rendered segments `[R, 4]` and observed ones beside them: the last two in the
/// other order of ends, the first beyond the cut-off.
fn segments() -> (Vec<f64>, Vec<f64>) {
    let projected = normal(RAYS * 4, 1);
    let observed = projected
        .chunks(4)
        .zip(normal(RAYS * 4, 2).chunks(4))
        .enumerate()
        .flat_map(|(ray, (ends, noise))| {
            let scale = if ray == 0 { 2.0 } else { 0.03 };
            let near: Vec<f64> = ends.iter().zip(noise).map(|(x, n)| x + scale * n).collect();
            match ray {
                3.. => [&near[2..], &near[..2]].concat(),
                _ => near,
            }
        })
        .collect();
    (projected, observed)
}

fn loss_of(projected: Tensor<2>, opacity: &[f64], config: SegmentLossConfig) -> SegmentLoss {
    let (_, observed) = segments();
    segment_loss(
        projected,
        constant(observed, [RAYS, 4]),
        constant(vec![0.9, 0.8, 0.7, 0.6, 0.5], [RAYS, 1]),
        constant(opacity.to_vec(), [RAYS, 1]),
        &cameras(),
        config,
    )
}

#[test]
fn segments_in_either_order() {
    let (projected, _) = segments();
    let all_opaque = [1.0; RAYS];
    assert_differentiates("d projected", &projected, [RAYS, 4], 1e-6, |projected| {
        loss_of(projected, &all_opaque, CONFIG).loss
    });
    // Through the projection, from points before the cameras.
    let ends: Vec<f64> = normal(RAYS * 6, 3).iter().map(|x| 0.3 * x).collect();
    assert_differentiates("d ends", &ends, [RAYS, 6], 1e-6, |ends| {
        let projected = project_calibrated(ends, &cameras());
        let config = SegmentLossConfig {
            cutoff_in_pixels: 1e6,
            ..CONFIG
        };
        loss_of(projected, &all_opaque, config).loss
    });
}

#[test]
fn what_counts_is_near_and_opaque() {
    let (projected, observed) = segments();
    let opacity = [1.0, 1.0, 0.2, 1.0, 1.0];
    let loss = |config| loss_of(constant(projected.clone(), [RAYS, 4]), &opacity, config);
    let counting = loss(CONFIG);
    assert_eq!(numbers(counting.counted.clone()), [0.0, 1.0, 0.0, 1.0, 1.0]);
    let everyone = loss(SegmentLossConfig {
        mean_over_all_rays: true,
        ..CONFIG
    });
    let ratio = numbers(counting.loss)[0] / numbers(everyone.loss)[0];
    assert!((ratio - 5.0 / 3.0).abs() < 1e-12, "{ratio}");

    let target = numbers(counting.target);
    assert_eq!(target[4..8], observed[4..8], "order kept");
    assert_eq!(target[12..14], observed[14..16], "order swapped");
    assert_eq!(target[14..16], observed[12..14], "order swapped");
}

#[test]
fn matched_junctions() {
    let matched = MatchedJunctions {
        targets: vec![[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6], [0.7, -0.8, 0.9]],
        targets_calibrated: vec![[0.1, 0.2], [-0.3, 0.4], [0.5, -0.6]],
        junction_of_target: vec![3, 0, 4],
    };
    let (junctions, calibrated) = (normal(15, 4), normal(10, 5));
    let loss = |junctions, calibrated| {
        junction_loss(junctions, Some(calibrated), &matched).expect("three pairs")
    };
    let fixed_calibrated = constant(calibrated.clone(), [5, 2]);
    assert_differentiates("d junctions", &junctions, [5, 3], 1e-7, |junctions| {
        loss(junctions, fixed_calibrated.clone()).in_world
    });
    let fixed_junctions = constant(junctions, [5, 3]);
    assert_differentiates("d calibrated", &calibrated, [5, 2], 1e-7, |calibrated| {
        let loss = loss(fixed_junctions.clone(), calibrated);
        loss.calibrated.expect("projections were given")
    });
}

#[test]
fn without_pairs_there_is_no_junction_loss() {
    let nothing = MatchedJunctions::default();
    assert!(junction_loss(constant(normal(15, 4), [5, 3]), None, &nothing).is_none());
}

#[test]
fn color_eikonal_and_mask() {
    let observed = constant(normal(12, 6), [4, 3]);
    assert_differentiates("rgb", &normal(12, 7), [4, 3], 1e-7, |rendered| {
        rgb_loss(rendered, observed.clone())
    });
    assert_differentiates("eikonal", &normal(12, 8), [4, 3], 1e-7, eikonal_loss);
    let mask = constant(vec![1.0, 0.0, 1.0, 0.0], [4, 1]);
    assert_differentiates("mask", &[0.9, 0.2, 0.4, 0.6], [4, 1], 1e-7, |opacity| {
        mask_loss(opacity, mask.clone())
    });
}
