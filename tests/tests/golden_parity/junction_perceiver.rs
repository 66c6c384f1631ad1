//! Case 07: junctions from latents, and the losses of matched junctions.

use crate::segment_projection::{camera, same_camera};
use burn::tensor::{Device, Tensor};
use neat_core::Camera;
use neat_gjp::junction_loss::{MatchedJunctions, junction_loss};
use neat_gjp::{JunctionCount, PerceiverConfig};
use neat_tensor::cameras::project_calibrated;
use neat_tensor::parameters::load_parameters;
use neat_tensor::random::{Purpose, stream};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::assert_relatively_close;
use neat_tests::golden::Golden;
use neat_tests::named_gradients::{assert_gradients_close, named_gradients};
use neat_tests::published_names::{gradients, parameters};
use neat_tests::tensors::numbers;

const TOLERANCE: f64 = 1e-5;

/// The calibrated projections `[N, 2]` of points `[N, 3]` in one camera.
fn project(points: Tensor<2>, camera: &Camera) -> Tensor<2> {
    let cameras = same_camera(camera, points.dims()[0], &points.device());
    let ends = Tensor::cat(vec![points.clone(), points], 1);
    project_calibrated(ends, &cameras).narrow(1, 0, 2)
}

fn check(golden: &Golden, camera: &Camera, problem: &str, device: &Device) {
    let config = PerceiverConfig {
        junctions: JunctionCount::Fixed(64),
        width: 32,
    };
    let untrained = config.init(&mut stream(0, Purpose::Weights, 0), device);
    let untrained = untrained.expect("some junctions");
    let values = parameters(golden, &format!("{problem}/param/"));
    let perceiver = load_parameters(untrained, values, None).expect("published architecture");

    let junctions = perceiver.junctions();
    let name = format!("{problem}/j3d_global");
    let truth = golden.numbers(&name);
    assert_relatively_close(&name, &numbers(junctions.clone()), &truth, TOLERANCE);
    let calibrated = project(junctions, camera);
    let name = format!("{problem}/j2d_global_calib");
    assert_relatively_close(
        &name,
        &numbers(calibrated),
        &golden.numbers(&name),
        TOLERANCE,
    );

    let local = golden.float_rows::<3>(&format!("{problem}/j3d_local"));
    let local_calibrated = golden.float_rows::<2>(&format!("{problem}/j2d_local_calib"));
    let rows = golden.indices(&format!("{problem}/assign_row_local"));
    let matched = MatchedJunctions {
        targets: rows.iter().map(|&row| local[row]).collect(),
        targets_calibrated: rows.iter().map(|&row| local_calibrated[row]).collect(),
        junction_of_target: golden.indices(&format!("{problem}/assign_col_global")),
    };
    // Each loss gets a graph of its own: going back consumes it.
    for term in ["j3d_loss", "j2d_loss"] {
        let junctions = perceiver.junctions();
        let calibrated = project(junctions.clone(), camera);
        let losses = junction_loss(junctions, Some(calibrated), &matched).expect("pairs");
        let loss = match term {
            "j3d_loss" => losses.in_world,
            _ => losses.calibrated.expect("projections were given"),
        };
        let gradients_of_loss = loss.backward();
        let truth = golden.numbers(&format!("f64.{problem}/{term}"));
        let what = format!("{problem} {term}");
        assert_relatively_close(&what, &numbers(loss), &truth, TOLERANCE);
        assert_gradients_close(
            &what,
            &named_gradients(&perceiver, gradients_of_loss),
            &gradients(golden, &format!("f64.{problem}/d{term}/")),
            TOLERANCE,
            TOLERANCE,
        );
    }
}

#[test]
fn junctions_and_the_losses_of_matched_ones() {
    let golden = Golden::open("07_gjp_assignment");
    let camera = camera(&golden, "K", "pose_c2w");
    on_each_backend(|device| {
        for problem in ["p20x64", "p64x64", "p90x64"] {
            check(&golden, &camera, problem, &device);
        }
    });
}
