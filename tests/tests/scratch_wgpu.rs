//! x
use burn::tensor::*;
use neat_tests::comparison::max_difference;
use neat_tests::tensors::numbers;
#[test]
fn t() {
    let w = neat_tensor::Backend::Wgpu.device().unwrap().autodiff();
    let f = neat_tensor::Backend::Flex.device().unwrap().autodiff();
    let t = |r: usize, c: usize, s: usize, d: &Device| {
        let v: Vec<f32> = (0..r * c).map(|i| (((i * 7919 + s * 31) % 1000) as f32) / 500.0 - 1.0).collect();
        Tensor::<2>::from_data(TensorData::new(v, [r, c]), d)
    };
    let run = |what: &str, r: usize, c: usize, g: &dyn Fn(Tensor<2>, &Device) -> Tensor<2>| {
        let go = |d: &Device| {
            let x = t(r, c, 1, d).require_grad();
            let y = g(x.clone(), d);
            let [a, b] = y.dims();
            let gr = (y.clone() * t(a, b, 9, d)).sum().backward();
            (numbers(y), numbers(x.grad(&gr).unwrap()))
        };
        let (a, b) = (go(&w), go(&f));
        eprintln!("{what}: {:.2e} {:.2e}", max_difference(&a.0, &b.0), max_difference(&a.1, &b.1));
    };
    run("cat 3 5", 96, 3, &|x, d| Tensor::cat(vec![x, t(96, 5, 2, d)], 1));
    run("cat 5 3", 96, 3, &|x, d| Tensor::cat(vec![t(96, 5, 2, d), x], 1));
    run("cat x x", 96, 3, &|x, _| Tensor::cat(vec![x.clone(), x], 1));
    run("narrow", 96, 8, &|x, _| x.narrow(1, 0, 3));
    run("relu", 96, 8, &|x, _| activation::relu(x));
    run("sigmoid", 96, 3, &|x, _| activation::sigmoid(x));
    run("matmul 41 32", 96, 41, &|x, d| neat_tensor::matmul::matmul(x, t(32, 41, 3, d).transpose()));
    run("matmul 32 6", 96, 32, &|x, d| neat_tensor::matmul::matmul(x, t(6, 32, 3, d).transpose()));
    run("matmul 32 32", 96, 32, &|x, d| neat_tensor::matmul::matmul(x, t(32, 32, 3, d).transpose()));
    run("matmul 44 32", 96, 44, &|x, d| neat_tensor::matmul::matmul(x, t(32, 44, 3, d).transpose()));
    run("matmul W", 32, 41, &|x, d| neat_tensor::matmul::matmul(t(96, 41, 3, d), x.transpose()));
    run("+bias", 1, 32, &|x, d| t(96, 32, 3, d) + x);
}
