//! Latents and the decoder that turns them into junctions (paper eq. 3).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use neat_tensor::random::standard_normal;
use neat_tensor::{NetworkSizeError, ReluMlp};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// How many global junctions there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a number of junctions, or \"auto\"")]
pub enum JunctionCount {
    /// So many.
    Fixed(usize),
    /// As many as the 2D wireframes of a scene ask for.
    FromData(FromData),
}

/// The word for a number that the data decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FromData {
    /// `"auto"`.
    #[serde(rename = "auto")]
    Auto,
}

impl JunctionCount {
    /// `"auto"`.
    pub const AUTO: Self = Self::FromData(FromData::Auto);

    /// The number; `None` while it is not decided.
    pub fn fixed(self) -> Option<usize> {
        match self {
            Self::Fixed(count) => Some(count),
            Self::FromData(FromData::Auto) => None,
        }
    }
}

/// Number and width of the latents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PerceiverConfig {
    /// Number of global junctions `N`.
    pub junctions: JunctionCount,
    /// Width of each latent and of the decoder's two hidden layers.
    pub width: usize,
}

impl Default for PerceiverConfig {
    /// As published for ABC: 64 junctions, 256 wide.
    fn default() -> Self {
        Self {
            junctions: JunctionCount::Fixed(64),
            width: 256,
        }
    }
}

/// `N` learned latents and a perceptron with two hidden layers.
#[derive(Module, Debug)]
pub struct JunctionPerceiver {
    /// `[N, C]`, standard normal at the start.
    pub latents: Param<Tensor<2>>,
    /// `C → C → C → 3`.
    pub decoder: ReluMlp,
}

impl PerceiverConfig {
    /// The number of junctions, if there can be such a perceiver.
    ///
    /// # Errors
    /// If the number is not decided, or there is no junction or no width.
    pub fn validate(&self) -> Result<usize, NetworkSizeError> {
        match self.junctions.fixed() {
            None => Err("model.perceiver.junctions is not decided for this scene"),
            Some(0) => Err("model.perceiver needs junctions"),
            Some(_) if self.width == 0 => Err("model.perceiver needs a width"),
            Some(junctions) => Ok(junctions),
        }
        .map_err(NetworkSizeError)
    }

    /// Random latents and decoder.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn init(
        &self,
        rng: &mut impl Rng,
        device: &Device,
    ) -> Result<JunctionPerceiver, NetworkSizeError> {
        let junctions = self.validate()?;
        let latents: Vec<f32> = (0..junctions * self.width)
            .map(|_| standard_normal(rng) as f32)
            .collect();
        let widths = [self.width, self.width, self.width, 3];
        Ok(JunctionPerceiver {
            latents: Param::from_data(TensorData::new(latents, [junctions, self.width]), device),
            decoder: ReluMlp::new(&widths, false, rng, device),
        })
    }
}

impl JunctionPerceiver {
    /// The global junctions `[N, 3]` in the world.
    pub fn junctions(&self) -> Tensor<2> {
        self.decoder.forward(self.latents.val())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_junctions_is_a_number_or_auto() {
        let parse = |text: &str| toml::from_str::<PerceiverConfig>(text);
        let fixed = parse("junctions = 24").unwrap();
        assert_eq!(fixed.junctions.fixed(), Some(24));
        let auto = parse(r#"junctions = "auto""#).unwrap();
        assert_eq!(auto.junctions, JunctionCount::AUTO);
        assert_eq!(auto.junctions.fixed(), None);
        for config in [fixed, auto] {
            let text = toml::to_string(&config).unwrap();
            assert_eq!(parse(&text).unwrap(), config);
        }
        let error = parse(r#"junctions = "many""#).unwrap_err().to_string();
        assert!(error.contains("\"auto\""), "{error}");
        assert!(parse("junctions = -1").is_err());
    }
}
