//! What lies outside the scene ball: light from concentric shells.
//!
//! Multi-sphere images (Broxton et al. 2020; Attal et al. 2020) in the inverse distances of
//! NeRF++ (Zhang et al. 2020), here with a network that says what each point of a shell is.

use crate::ray_sampler::RayBundle;
use crate::volume_rendering::{integrate, rendering_weights};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData, activation};
use neat_tensor::host::point_tensor;
use neat_tensor::{GridEncoding, NetworkSizeError, PointEncoding, ReluMlp, RowChoice};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Shells behind the scene, and the network that colours them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BackgroundConfig {
    /// Number of shells, evenly spaced in inverse distance from the centre; 0 leaves what is
    /// behind the scene to the bounding sphere, or black.
    pub shells: usize,
    /// Number of hidden layers.
    pub hidden_layers: usize,
    /// Width of the hidden layers.
    pub width: usize,
    /// What a point has beside its coordinates.
    pub encoding: PointEncoding,
}

impl Default for BackgroundConfig {
    /// No shells, as published.
    fn default() -> Self {
        Self {
            shells: 0,
            hidden_layers: 1,
            width: 64,
            encoding: PointEncoding::Sine,
        }
    }
}

/// Point outside the ball → density per shell and colour. It does not see the viewing
/// direction: what is far away looks alike from everywhere.
#[derive(Module, Debug)]
pub struct BackgroundNetwork {
    /// The perceptron; output 0 is what the density is made of.
    pub mlp: ReluMlp,
    /// Learned grids over the contracted space, if any.
    pub grid: Option<GridEncoding>,
    /// Number of shells.
    #[module(skip)]
    pub shells: usize,
    /// Radius of the ball that they surround.
    #[module(skip)]
    pub scene_radius: f64,
}

impl BackgroundConfig {
    /// A network around a scene of radius `scene_radius`; `None` without shells.
    ///
    /// # Errors
    /// If there can be no such encoding.
    pub fn init(
        &self,
        scene_radius: f64,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<Option<BackgroundNetwork>, NetworkSizeError> {
        if self.shells == 0 {
            return Ok(None);
        }
        let mut widths = vec![3 + self.encoding.width()];
        widths.extend(vec![self.width; self.hidden_layers]);
        widths.push(4);
        Ok(Some(BackgroundNetwork {
            mlp: ReluMlp::new(&widths, false, rng, device),
            grid: self.encoding.init(1.0, rng, device)?,
            shells: self.shells,
            scene_radius,
        }))
    }
}

/// Where rays leave the shells.
struct Crossings {
    /// In contracted space, `[R · shells]`, near to far.
    points: Vec<[f32; 3]>,
    /// 1, or 0 where a ray leaves no such shell before it, `[R · shells]`.
    crossed: Vec<f32>,
}

impl BackgroundNetwork {
    /// The light `[R, 3]` that comes in along the rays of these indices, from outside the ball.
    /// What passes all other shells comes from the last.
    pub fn light(
        &self,
        rays: &RayBundle,
        indices: impl ExactSizeIterator<Item = usize>,
        device: &Device,
    ) -> Tensor<2> {
        let count = indices.len();
        let Crossings { points, crossed } = self.crossings(rays, indices);
        let crossed = TensorData::new(crossed, [count, self.shells]);
        let crossed = Tensor::<2>::from_data(crossed, device);
        let points = point_tensor(&points, device);
        let inputs = match &self.grid {
            Some(grid) => grid.append(&self.mlp.kernels, points.clone(), points),
            None => points,
        };
        light_of_shells(self.mlp.forward(inputs), crossed)
    }

    /// `color` `[R, 3]` of rays of which the scene covers `opacity` `[R, 1]`, with the light
    /// that comes from behind it along the rays `open`.
    pub fn behind(
        &self,
        color: Tensor<2>,
        opacity: Tensor<2>,
        rays: &RayBundle,
        open: &[usize],
        device: &Device,
    ) -> Tensor<2> {
        if open.is_empty() {
            return color;
        }
        let rows = RowChoice::new(open.iter().map(|ray| *ray as u32), rays.len());
        let backend = self.mlp.kernels.of(&opacity);
        let passed = backend.pick_rows(&rows, opacity).neg().add_scalar(1.0);
        let light = self.light(rays, open.iter().copied(), device);
        color + backend.add_up_rows(&rows, light * passed)
    }

    fn crossings(&self, rays: &RayBundle, indices: impl Iterator<Item = usize>) -> Crossings {
        let mut crossings = Crossings {
            points: Vec::new(),
            crossed: Vec::new(),
        };
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for ray in indices {
            let (origin, direction) = (rays.origins[ray], rays.directions[ray]);
            let along = dot(origin, direction);
            for shell in 0..self.shells {
                // Inverse distance as a share of that of the ball.
                let inverse = 1.0 - (shell as f32 + 0.5) / self.shells as f32;
                let radius = self.scene_radius as f32 / inverse;
                let half = along * along - dot(origin, origin) + radius * radius;
                let z = half.max(0.0).sqrt() - along;
                let point = rays.point(ray, z.max(0.0));
                let length = dot(point, point).sqrt().max(f32::MIN_POSITIVE);
                // From half of the unit ball's radius, at the scene ball, to all of it.
                let contracted = (1.0 - 0.5 * inverse) / length;
                crossings.points.push(point.map(|x| x * contracted));
                let is_before = half > 0.0 && z > 0.0;
                crossings.crossed.push(f32::from(u8::from(is_before)));
            }
        }
        crossings
    }
}

/// The light `[R, 3]` of shells, near to far, by what the network says of them `[R · S, 4]`:
/// the density before a softplus, and the colour before a sigmoid. Only those count that are
/// `crossed` `[R, S]` (1, else 0); the last lets nothing pass.
pub fn light_of_shells(outputs: Tensor<2>, crossed: Tensor<2>) -> Tensor<2> {
    let [rays, shells] = crossed.dims();
    let density = outputs.clone().narrow(1, 0, 1).reshape([rays, shells]);
    // At first all shells matter about alike.
    let density = activation::softplus(density.sub_scalar((shells as f64).ln()), 1.0);
    let before = |t: Tensor<2>| t.narrow(1, 0, shells - 1);
    let weights = rendering_weights(before(density), before(crossed));
    let rest = weights.clone().sum_dim(1).neg().add_scalar(1.0);
    let colors = activation::sigmoid(outputs.narrow(1, 1, 3));
    integrate(Tensor::cat(vec![weights, rest], 1), colors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::module::Param;
    use neat_tensor::host::host_points;
    use neat_tensor::random::{Purpose, stream};

    fn device() -> Device {
        neat_tensor::Backend::Auto.device().expect("a backend")
    }

    fn network(scene_radius: f64) -> BackgroundNetwork {
        let config = BackgroundConfig {
            shells: 4,
            ..BackgroundConfig::default()
        };
        let mut rng = stream(3, Purpose::Weights, 0);
        let network = config.init(scene_radius, &mut rng, &device());
        network.expect("a size").expect("shells")
    }

    fn rays(from: &[([f32; 3], [f32; 3])]) -> RayBundle {
        RayBundle {
            origins: from.iter().map(|ray| ray.0).collect(),
            directions: from.iter().map(|ray| ray.1).collect(),
        }
    }

    #[test]
    fn rays_cross_shells_at_even_inverse_distances() {
        let network = network(2.0);
        let rays = rays(&[([0.5, -2.0, -5.0], [0.0, 0.6, 0.8])]);
        let Crossings { points, crossed } = network.crossings(&rays, 0..1);
        assert_eq!(crossed, [1.0; 4]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for (shell, point) in points.into_iter().enumerate() {
            let inverse = 1.0 - (shell as f32 + 0.5) / 4.0;
            let length = dot(point, point).sqrt();
            assert!((length - (1.0 - 0.5 * inverse)).abs() < 1e-6, "{point:?}");
            // Away from the centre by the scene's radius over the inverse distance, it lies
            // on the ray.
            let [x, y, z] = point.map(|c| c / length * 2.0 / inverse);
            let along = (y + 2.0) / 0.6;
            assert!(along > 0.0, "{point:?}");
            let off = [x - 0.5, z - (along * 0.8 - 5.0)];
            assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
        }
    }

    #[test]
    fn shells_behind_a_camera_pass_all_light() {
        let network = network(1.0);
        // Shells lie at 8/7, 8/5, 8/3 and 8: one camera between the first two looks away,
        // and another passes them all by but for the last.
        let away = ([0.0, 0.0, 1.3], [0.0, 0.0, 1.0]);
        let beside = ([0.0, 3.0, -9.0], [0.0, 0.0, 1.0]);
        let crossings = network.crossings(&rays(&[away, beside]), 0..2);
        assert_eq!(crossings.crossed, [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn all_light_comes_from_some_shell() {
        let mut network = network(1.0);
        let bias = [0.3f32, 0.5, -1.0, 2.0];
        let last = network.mlp.layers.last_mut().expect("a layer");
        last.weight = Some(Param::from_tensor(Tensor::zeros([4, 64], &device())));
        last.bias = Param::from_data(bias, &device());
        let rays = rays(&[
            ([0.0, 0.0, 1.3], [0.0, 0.0, 1.0]),
            ([0.0, 0.2, 0.0], [1.0, 0.0, 0.0]),
        ]);
        let sigmoid = |x: f32| 1.0 / (1.0 + (-x).exp());
        for light in host_points(network.light(&rays, 0..2, &device())) {
            for (light, bias) in light.iter().zip(&bias[1..]) {
                assert!((light - sigmoid(*bias)).abs() < 1e-6, "{light}");
            }
        }
    }

    #[test]
    fn no_shells_no_network() {
        let config = BackgroundConfig::default();
        let mut rng = stream(0, Purpose::Weights, 0);
        assert!(config.init(1.0, &mut rng, &device()).unwrap().is_none());
    }
}
