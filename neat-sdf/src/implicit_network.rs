//! The signed distance network (VolSDF; paper Appendix C.1).

mod config;

pub use config::ImplicitNetworkConfig;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use neat_tensor::kernels::cpu::softplus_network::SoftplusNetwork;
use neat_tensor::{CoordinateMlp, FieldQuery, KnownPass, KnownRows};
use std::sync::{Arc, OnceLock};

/// What the network says of `N` points.
#[derive(Clone, Debug)]
pub struct ImplicitOutput {
    /// Signed distance `[N, 1]`.
    pub sdf: Tensor<2>,
    /// Features `[N, F]`, never capped.
    pub features: Tensor<2>,
    /// Raw gradient of the distance `[N, 3]`.
    pub gradient: Tensor<2>,
    /// The same without the bounding sphere, `[N, 3]`: what the eikonal term looks
    /// at.
    pub gradient_uncapped: Tensor<2>,
}

/// Points → signed distance and features.
#[derive(Module, Debug)]
pub struct ImplicitNetwork {
    /// The perceptron; output 0 is the distance.
    pub mlp: CoordinateMlp,
    /// Slope of the bounding sphere, if any.
    #[module(skip)]
    pub bounding_sphere_slope: Option<f64>,
    /// Radius of the scene and of the bounding sphere.
    #[module(skip)]
    pub scene_radius: f64,
}

impl ImplicitNetwork {
    /// Distance capped by the bounding sphere, features, and the gradient of the
    /// capped distance, at every point. This is what is rendered.
    pub fn evaluate(&self, points: Tensor<2>) -> ImplicitOutput {
        self.evaluate_rows(points, 0, None).1
    }

    /// The capped distance `[N, 1]` at all points, and all of [`Self::evaluate`] at
    /// all but the last `light_rows`; `known` is what [`Distances::pass`] said of
    /// the points, with the same parameters.
    pub fn evaluate_rows(
        &self,
        points: Tensor<2>,
        light_rows: usize,
        known: Option<KnownRows>,
    ) -> (Tensor<2>, ImplicitOutput) {
        let full_rows = points.dims()[0] - light_rows;
        let query = FieldQuery {
            light_rows,
            known,
            others: true,
        };
        let field = self.mlp.field(points.clone(), query);
        let features = field.others.expect("features were asked for");
        let head = |t: Tensor<2>| t.narrow(0, 0, full_rows);
        let Some(cap) = self.cap(&points) else {
            let output = ImplicitOutput {
                sdf: head(field.first.clone()),
                features,
                gradient: field.gradient.clone(),
                gradient_uncapped: field.gradient,
            };
            return (field.first, output);
        };
        let capped = field.first.clone().greater(cap.value.clone());
        let sdf = field.first.mask_where(capped.clone(), cap.value);
        let gradient_capped = capped.narrow(0, 0, full_rows).expand([full_rows, 3]);
        let output = ImplicitOutput {
            sdf: head(sdf.clone()),
            features,
            gradient: (field.gradient.clone()).mask_where(gradient_capped, head(cap.gradient)),
            gradient_uncapped: field.gradient,
        };
        (sdf, output)
    }

    /// Distance, features and gradient without the bounding sphere.
    pub fn evaluate_uncapped(&self, points: Tensor<2>) -> ImplicitOutput {
        let query = FieldQuery {
            others: true,
            ..FieldQuery::default()
        };
        let field = self.mlp.field(points, query);
        ImplicitOutput {
            sdf: field.first,
            features: field.others.expect("features were asked for"),
            gradient: field.gradient.clone(),
            gradient_uncapped: field.gradient,
        }
    }

    /// The gradient of the distance without the bounding sphere, `[N, 3]`: what
    /// the eikonal term looks at.
    pub fn gradient_uncapped(&self, points: Tensor<2>) -> Tensor<2> {
        self.mlp.field(points, FieldQuery::default()).gradient
    }

    /// The distance without the bounding sphere, `[N, 1]`: what the term of sparse
    /// points looks at.
    pub fn sdf_uncapped(&self, points: Tensor<2>) -> Tensor<2> {
        // The fused operation: with its gradient, faster than plain operations.
        self.mlp.field(points, FieldQuery::default()).first
    }

    /// The capped distance alone, `[N, 1]`.
    pub fn sdf(&self, points: Tensor<2>) -> Tensor<2> {
        let raw = self.mlp.forward(points.clone()).narrow(1, 0, 1);
        match self.cap(&points) {
            None => raw,
            Some(Cap { value, .. }) => {
                let capped = raw.clone().greater(value.clone());
                raw.mask_where(capped, value)
            }
        }
    }

    /// A query for distances at points on the host, with the parameters as they
    /// are now and without gradients: computed there too where `device`, which
    /// holds the network, is the CPU.
    pub fn distances(&self, device: &Device) -> Distances {
        Distances {
            network: self.valid(),
            device: device.clone().inner(),
            prepared: OnceLock::new(),
        }
    }

    fn cap(&self, points: &Tensor<2>) -> Option<Cap> {
        let slope = self.bounding_sphere_slope?;
        let distance = points.clone().square().sum_dim(1).sqrt();
        Some(Cap {
            value: distance
                .clone()
                .neg()
                .add_scalar(self.scene_radius)
                .mul_scalar(slope),
            gradient: points.clone().div(distance).mul_scalar(-slope),
        })
    }
}

/// The bounding sphere's distance `[N, 1]` and its gradient `[N, 3]`.
struct Cap {
    value: Tensor<2>,
    gradient: Tensor<2>,
}

/// A network that answers for distances at points on the host. It is prepared
/// when it is first asked.
#[derive(Debug)]
pub struct Distances {
    network: ImplicitNetwork,
    device: Device,
    prepared: OnceLock<Option<SoftplusNetwork<'static>>>,
}

/// Points per call of a device: bounds the memory of a query.
const POINT_CHUNK: usize = 16_384;

impl Distances {
    /// The network's distance at each point, without the bounding sphere.
    pub fn uncapped(&self, points: &[[f32; 3]]) -> Vec<f32> {
        if let Some(network) = self.on_host() {
            return network.first(points.as_flattened());
        }
        points
            .chunks(POINT_CHUNK)
            .flat_map(|chunk| {
                let flat = chunk.as_flattened().to_vec();
                let points = TensorData::new(flat, [chunk.len(), 3]);
                let points = Tensor::from_data(points, &self.device);
                let outputs = self.network.mlp.forward(points);
                let data = outputs.narrow(1, 0, 1).into_data().convert::<f32>();
                data.try_into_vec_as::<f32>()
                    .expect("Distances: just converted to float32")
            })
            .collect()
    }

    fn on_host(&self) -> Option<&SoftplusNetwork<'static>> {
        let prepared = self.prepared.get_or_init(|| self.network.mlp.on_host());
        prepared.as_ref()
    }

    /// [`Self::uncapped`], and where there is room the pass itself, for
    /// [`ImplicitNetwork::evaluate_rows`].
    pub fn pass(&self, points: &[[f32; 3]]) -> (Vec<f32>, Option<Arc<KnownPass>>) {
        let pass = self
            .on_host()
            .and_then(|network| self.network.mlp.known_pass(network, points.as_flattened()));
        match pass {
            Some(pass) => (pass.pass.first.clone(), Some(Arc::new(pass))),
            None => (self.uncapped(points), None),
        }
    }

    /// The capped distance at each point.
    pub fn capped(&self, points: &[[f32; 3]]) -> Vec<f32> {
        let mut distances = self.uncapped(points);
        self.cap(points, &mut distances);
        distances
    }

    /// Caps distances at `points` by the bounding sphere.
    pub fn cap(&self, points: &[[f32; 3]], distances: &mut [f32]) {
        let Some(slope) = self.network.bounding_sphere_slope else {
            return;
        };
        let (slope, radius) = (slope as f32, self.network.scene_radius as f32);
        for (distance, [x, y, z]) in distances.iter_mut().zip(points) {
            let cap = slope * (radius - (x * x + y * y + z * z).sqrt());
            // Not `min`, which would hide a distance that is no number.
            if *distance > cap {
                *distance = cap;
            }
        }
    }
}
