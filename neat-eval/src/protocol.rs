//! The protocols by name.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A published way to measure edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// [`NeatAbc`](crate::NeatAbc).
    NeatAbc,
    /// [`NeatSurface::dtu`](crate::NeatSurface::dtu).
    NeatDtu,
    /// [`NeatSurface::blended_mvs`](crate::NeatSurface::blended_mvs).
    NeatBlendedMvs,
    /// [`EdgePoints::emap`](crate::EdgePoints::emap).
    Emap,
    /// [`EdgePoints::curve_gaussian`](crate::EdgePoints::curve_gaussian).
    CurveGaussian,
    /// [`EdgePoints::edge_gaussians`](crate::EdgePoints::edge_gaussians).
    EdgeGaussians,
    /// [`EdgePoints::nef`](crate::EdgePoints::nef).
    Nef,
    /// [`LimapLength::hypersim`](crate::LimapLength::hypersim).
    LimapHypersim,
    /// [`LimapLength::tanks_and_temples`](crate::LimapLength::tanks_and_temples).
    LimapTnt,
    /// [`StructureScore`](crate::StructureScore).
    Hss,
    /// [`EditDistance`](crate::EditDistance).
    Wed,
}

impl Protocol {
    /// All protocols.
    pub const ALL: [Self; 11] = [
        Self::NeatAbc,
        Self::NeatDtu,
        Self::NeatBlendedMvs,
        Self::Emap,
        Self::CurveGaussian,
        Self::EdgeGaussians,
        Self::Nef,
        Self::LimapHypersim,
        Self::LimapTnt,
        Self::Hss,
        Self::Wed,
    ];

    /// The name, as in files and on command lines.
    pub fn name(self) -> &'static str {
        match self {
            Self::NeatAbc => "neat-abc",
            Self::NeatDtu => "neat-dtu",
            Self::NeatBlendedMvs => "neat-blended-mvs",
            Self::Emap => "emap",
            Self::CurveGaussian => "curve-gaussian",
            Self::EdgeGaussians => "edge-gaussians",
            Self::Nef => "nef",
            Self::LimapHypersim => "limap-hypersim",
            Self::LimapTnt => "limap-tnt",
            Self::Hss => "hss",
            Self::Wed => "wed",
        }
    }

    /// What it measures, in one line.
    pub fn explanation(self) -> &'static str {
        match self {
            Self::NeatAbc => {
                "precision and recall of junctions and segments at 0.01, 0.02 and 0.05, paired one to one"
            }
            Self::NeatDtu => {
                "distance to DTU's scan (ACC, completeness): thinned to 0.2 mm, observation mask, table plane, cut at 20 mm"
            }
            Self::NeatBlendedMvs => {
                "distance to surface points (ACC, completeness), all of them, cut at 20"
            }
            Self::Emap => {
                "edge points on ABC-NEF, every 0.005, averaged in cells of 2/256; at 5, 10 and 20 mm"
            }
            Self::CurveGaussian => {
                "edge points on ABC-NEF, every 0.005, averaged in cells of 1/256; at 5, 10 and 20 mm"
            }
            Self::EdgeGaussians => {
                "edge points on ABC-NEF, every 0.005, none left out; at 5, 10 and 20 mm"
            }
            Self::Nef => {
                "edge points on ABC-NEF, 500 per edge, averaged in cells of 1/64, truth as given; at 20 mm"
            }
            Self::LimapHypersim => {
                "length recall and percentage of right lines at 1, 5 and 10 mm from surface points in metres"
            }
            Self::LimapTnt => {
                "length recall and percentage of right lines at 1 mm to 1 m from surface points in metres"
            }
            Self::Hss => {
                "hybrid structure score of buildings: F1 of vertices and IoU of edges at 0.5 m"
            }
            Self::Wed => "wireframe edit distance of buildings, by the length of the truth",
        }
    }

    /// Where it is published.
    pub fn source(self) -> &'static str {
        match self {
            Self::NeatAbc => "NEAT, CVPR 2024, Table 6; evaluation/eval-abc.py of cherubicXN/neat",
            Self::NeatDtu => {
                "NEAT, CVPR 2024, Tables 1, 4 and 5; evaluation/eval-lsr-dtu.py of cherubicXN/neat, after jzhangbs/DTUeval-python"
            }
            Self::NeatBlendedMvs => {
                "NEAT, CVPR 2024, Tables 1 and 4; evaluation/eval-lsr-bmvs.py of cherubicXN/neat"
            }
            Self::Emap => "EMAP, CVPR 2024; src/eval/eval_ABC.py of cvg/EMAP",
            Self::CurveGaussian => {
                "CurveGaussian, ICCV 2025; edge_extraction/eval_ABC.py of zhirui-gao/Curve-Gaussian"
            }
            Self::EdgeGaussians => {
                "EdgeGaussians, WACV 2025; eval.py of kunalchelani/EdgeGaussians"
            }
            Self::Nef => {
                "NEF, CVPR 2023; parametric_curve/visualize_and_eval_NEF.py of yunfan1202/NEF_code"
            }
            Self::LimapHypersim => {
                "LIMAP, CVPR 2023, Table 1; scripts/eval_hypersim.py of cvg/limap"
            }
            Self::LimapTnt => "LIMAP, CVPR 2023; scripts/eval_tnt.py of cvg/limap",
            Self::Hss => "S23DR challenge 2025; hoho2025/metric_helper.py of s23dr/hoho2025",
            Self::Wed => "S23DR challenge 2024; hoho/wed.py of s23dr/hoho2025",
        }
    }

    /// Whether it compares with points on a surface, not with true edges.
    pub fn needs_surface(self) -> bool {
        matches!(
            self,
            Self::NeatDtu | Self::NeatBlendedMvs | Self::LimapHypersim | Self::LimapTnt
        )
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no protocol has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no protocol is called `{name}`; there are {}", Protocol::ALL.map(Protocol::name).join(", "))]
pub struct UnknownProtocol {
    /// The name.
    pub name: String,
}

impl FromStr for Protocol {
    type Err = UnknownProtocol;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|p| p.name() == name);
        found.ok_or_else(|| UnknownProtocol { name: name.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back() {
        for protocol in Protocol::ALL {
            assert_eq!(protocol.name().parse(), Ok(protocol));
            let json = serde_json::to_string(&protocol).unwrap();
            assert_eq!(json, format!("\"{}\"", protocol.name()));
        }
        let message = "neat".parse::<Protocol>().unwrap_err().to_string();
        assert!(message.contains("`neat`") && message.contains("neat-dtu, "));
    }
}
