//! Light from shells outside the scene ball.

use neat_sdf::background::light_of_shells;
use neat_tests::comparison::assert_close;
use neat_tests::finite_differences::{assert_differentiates, constant, normal};
use neat_tests::tensors::numbers;

const RAYS: usize = 3;
const SHELLS: usize = 4;
const SHAPE: [usize; 2] = [RAYS * SHELLS, 4];

/// One ray leaves all shells, one the last two, one the last alone.
fn crossed() -> burn::tensor::Tensor<2> {
    let crossed = [[1.0; SHELLS], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]];
    constant(crossed.concat(), [RAYS, SHELLS])
}

#[test]
fn light_differentiates() {
    let outputs = normal(RAYS * SHELLS * 4, 11);
    let fixed = constant(normal(RAYS * 3, 12), [RAYS, 3]);
    assert_differentiates("d outputs", &outputs, SHAPE, 1e-7, |outputs| {
        (light_of_shells(outputs, crossed()) * fixed.clone()).sum()
    });
}

#[test]
fn shells_cover_those_behind_them() {
    let outputs = normal(RAYS * SHELLS * 4, 13);
    let light = numbers(light_of_shells(constant(outputs.clone(), SHAPE), crossed()));
    let crossed = numbers(crossed());
    let mut expected = vec![0.0; RAYS * 3];
    for ray in 0..RAYS {
        let mut passed = 1.0;
        for shell in 0..SHELLS {
            let row = ray * SHELLS + shell;
            let [density, colour @ ..] = &outputs[4 * row..4 * row + 4] else {
                unreachable!("four numbers")
            };
            let density = (density - (SHELLS as f64).ln()).exp().ln_1p();
            let opacity = match shell {
                3 => 1.0,
                _ => 1.0 - (-density * crossed[row]).exp(),
            };
            for (channel, colour) in colour.iter().enumerate() {
                expected[3 * ray + channel] += passed * opacity / (1.0 + (-colour).exp());
            }
            passed *= 1.0 - opacity;
        }
    }
    assert_close("light", &light, &expected, 1e-12);
}
