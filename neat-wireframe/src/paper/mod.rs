//! The paper's way from rendered segments and learned junctions to a wireframe
//! (§4.3): refine, gather lines, vote, attract, check visibility.

mod attraction;
mod corner_evidence;
mod edge_candidates;
mod edge_choice;
mod image_refinement;
mod junction_merging;
mod junction_refinement;
mod junction_voting;
mod neat_lines;
mod rendered_lines;
mod settling;
mod visibility;

pub use attraction::{AttractionConfig, attract, attracted_ends};
pub use image_refinement::ImageRefinementConfig;
pub use junction_refinement::{
    JunctionRefinementConfig, RefinedJunction, RefinementError, refine_junctions,
};
pub use junction_voting::{JunctionVotes, JunctionVotingConfig, vote_for_junctions};
pub use neat_lines::{NeatLine, NeatLineConfig, SupportedSegment, neat_lines};
pub use visibility::{VisibilityConfig, seeing_views, squared_reprojection_distance};

use crate::used_junctions::UsedJunctions;
use crate::{SignedDistance, ViewObservation, Wireframe3d};
use image_refinement::{ImageGraph, refine_by_images};
use nalgebra::Vector3;
use neat_core::assignment::AssignmentError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tracing::debug;

/// Every threshold and switch of the paper's back end.
///
/// The defaults are the published numbers without the published slips;
/// [`PaperBackEndConfig::published`] repeats those too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PaperBackEndConfig {
    /// Rays → one line per 2D segment and view.
    pub neat_lines: NeatLineConfig,
    /// Junctions → onto the surface.
    pub junction_refinement: JunctionRefinementConfig,
    /// Lines and junctions → junctions that views agree on.
    pub junction_voting: JunctionVotingConfig,
    /// Lines and junctions → junctions where the images show them.
    pub image_refinement: ImageRefinementConfig,
    /// Lines and junctions → edges.
    pub attraction: AttractionConfig,
    /// Edges → edges that the images show.
    pub visibility: VisibilityConfig,
    /// Keep junctions that have no edge in the end. The published code exports
    /// and scores them.
    pub keep_isolated_junctions: bool,
}

impl Default for PaperBackEndConfig {
    fn default() -> Self {
        Self {
            neat_lines: NeatLineConfig::default(),
            junction_refinement: JunctionRefinementConfig::default(),
            junction_voting: JunctionVotingConfig::default(),
            image_refinement: ImageRefinementConfig::default(),
            attraction: AttractionConfig::default(),
            visibility: VisibilityConfig::default(),
            keep_isolated_junctions: true,
        }
    }
}

/// How many things entered and left each step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PaperBackEndCounts {
    /// Rays of all views.
    pub rays: usize,
    /// Rays among them that were not finite and left out.
    pub non_finite_rays: usize,
    /// NEAT lines of all views.
    pub lines: usize,
    /// Lines among them whose support points lie close enough.
    pub supported_lines: usize,
    /// Junctions given.
    pub junctions: usize,
    /// Junctions left after the refinement.
    pub refined_junctions: usize,
    /// Junctions with at least one vote; with [`ImageRefinementConfig::enabled`] the places
    /// that ends speak for.
    pub voted_junctions: usize,
    /// Distinct junctions with enough votes.
    pub kept_junctions: usize,
    /// Edges after the attraction; with [`ImageRefinementConfig::enabled`] the pairs of
    /// junctions that were asked.
    pub attracted_edges: usize,
    /// Edges seen in enough views.
    pub visible_edges: usize,
}

/// A wireframe with what is known about its parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaperWireframe {
    /// Distinct junctions, sorted by x, y and z; distinct edges `[i, j]` with
    /// `i ≤ j`, sorted.
    pub wireframe: Wireframe3d,
    /// Votes of each junction; with [`ImageRefinementConfig::enabled`] the number of views
    /// with a 2D segment that ends there.
    pub junction_votes: Vec<usize>,
    /// In how many views each edge is seen.
    pub visible_views: Vec<usize>,
    /// Numbers of every step.
    pub counts: PaperBackEndCounts,
}

/// Why there is no wireframe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperBackEndError {
    /// Rays must come as one list per view.
    #[error(
        "there are {views} views, but rays for {rays}: give one list of rays per view, empty where a view has none"
    )]
    ViewCount {
        /// Number of views.
        views: usize,
        /// Number of lists of rays.
        rays: usize,
    },
    /// Junctions could not be refined.
    #[error(transparent)]
    Refinement(#[from] RefinementError),
    /// Junctions and line ends could not be matched.
    #[error("junctions and line ends cannot be matched")]
    Assignment(#[from] AssignmentError),
}

impl PaperBackEndConfig {
    /// The published code to the letter, with its slips: edges without length are
    /// kept, and the cross product goes wrong for lines of three rays.
    pub fn published() -> Self {
        Self {
            neat_lines: NeatLineConfig {
                published_cross_product: true,
                ..Default::default()
            },
            attraction: AttractionConfig {
                exclude_self_loops: false,
            },
            ..Default::default()
        }
    }

    /// Runs all steps.
    ///
    /// - `junctions`: the learned global junctions, in the world.
    /// - `views`: the 2D evidence, with all segments above the smallest score
    ///   that the configuration names (0.01).
    /// - `rays`: per view, what the field renders along the rays of the thin
    ///   (1 px) attraction regions. Rays that are not finite are left out and counted.
    /// - `surface`: the learned signed distance.
    ///
    /// # Errors
    /// If there is not one list of rays per view, or junctions or distances are
    /// not finite.
    pub fn run(
        &self,
        junctions: &[Vector3<f64>],
        views: &[ViewObservation],
        rays: &[Vec<SupportedSegment>],
        surface: &(impl SignedDistance + ?Sized),
    ) -> Result<PaperWireframe, PaperBackEndError> {
        if views.len() != rays.len() {
            return Err(PaperBackEndError::ViewCount {
                views: views.len(),
                rays: rays.len(),
            });
        }
        let refined: Vec<Vector3<f64>> =
            refine_junctions(junctions, surface, &self.junction_refinement)?
                .into_iter()
                .map(|junction| junction.position)
                .collect();
        let lines_by_view: Vec<Vec<NeatLine>> = views
            .par_iter()
            .zip(rays)
            .map(|(view, rays)| neat_lines(view, rays, &self.neat_lines))
            .collect();
        let from_lines = PaperBackEndCounts {
            rays: rays.iter().map(Vec::len).sum(),
            non_finite_rays: rays.iter().flatten().filter(|ray| !ray.is_finite()).count(),
            lines: lines_by_view.iter().map(Vec::len).sum(),
            junctions: junctions.len(),
            refined_junctions: refined.len(),
            ..PaperBackEndCounts::default()
        };
        let mut result = match self.image_refinement.enabled {
            true => self.by_images(refined, views, &lines_by_view, from_lines),
            false => self.by_votes(&refined, views, &lines_by_view, from_lines)?,
        };
        debug!(counts = ?result.counts, "paper back end");
        if !self.keep_isolated_junctions {
            result.drop_isolated_junctions();
        }
        Ok(result)
    }

    /// As published: junctions that have votes, and edges that supported lines turn into.
    fn by_votes(
        &self,
        refined: &[Vector3<f64>],
        views: &[ViewObservation],
        lines_by_view: &[Vec<NeatLine>],
        counts: PaperBackEndCounts,
    ) -> Result<PaperWireframe, PaperBackEndError> {
        let votes = vote_for_junctions(refined, lines_by_view, &self.junction_voting)?;
        let kept = (votes.iter())
            .filter(|v| v.votes >= self.junction_voting.min_votes)
            .map(|v| (refined[v.junction], v.votes));
        let (junctions, junction_votes): (Vec<_>, Vec<_>) =
            distinct_and_sorted(kept.collect()).into_iter().unzip();
        let supported: Vec<_> = (lines_by_view.iter().flatten())
            .filter(|line| line.is_supported(&self.neat_lines))
            .map(|line| line.segment)
            .collect();
        let edges = attract(&supported, &junctions, &self.attraction);
        let attracted = Wireframe3d { junctions, edges };
        let seen = seeing_views(&attracted.segments(), views, &self.visibility);
        let (edges, visible_views): (Vec<_>, Vec<_>) = (attracted.edges.iter().zip(seen))
            .filter(|(_, seen)| *seen >= self.visibility.min_views)
            .unzip();
        Ok(PaperWireframe {
            junction_votes,
            visible_views,
            counts: PaperBackEndCounts {
                supported_lines: supported.len(),
                voted_junctions: votes.len(),
                kept_junctions: attracted.junctions.len(),
                attracted_edges: attracted.edges.len(),
                visible_edges: edges.len(),
                ..counts
            },
            wireframe: Wireframe3d {
                junctions: attracted.junctions,
                edges,
            },
        })
    }

    /// By the ends and segments of the images. All lines count as supported.
    fn by_images(
        &self,
        refined: Vec<Vector3<f64>>,
        views: &[ViewObservation],
        lines_by_view: &[Vec<NeatLine>],
        counts: PaperBackEndCounts,
    ) -> PaperWireframe {
        let by_images = &self.image_refinement;
        let ImageGraph {
            wireframe,
            junction_views,
            edge_views,
            settled,
            candidates,
        } = refine_by_images(refined, views, lines_by_view, by_images, &self.visibility);
        PaperWireframe {
            counts: PaperBackEndCounts {
                supported_lines: counts.lines,
                voted_junctions: settled,
                kept_junctions: wireframe.junctions.len(),
                attracted_edges: candidates,
                visible_edges: wireframe.edges.len(),
                ..counts
            },
            wireframe,
            junction_votes: junction_views,
            visible_views: edge_views,
        }
    }
}

impl PaperWireframe {
    /// Removes junctions without an edge; the order of the others stays.
    fn drop_isolated_junctions(&mut self) {
        let Wireframe3d { junctions, edges } = &mut self.wireframe;
        let used = UsedJunctions::new(junctions.len(), edges.iter());
        for edge in edges {
            *edge = used.renamed(*edge);
        }
        used.retain(junctions);
        used.retain(&mut self.junction_votes);
    }
}

/// Sorted by x, y and z. Of junctions at one place the one with most votes stays:
/// all lines would go to one of them anyway.
fn distinct_and_sorted(mut junctions: Vec<(Vector3<f64>, usize)>) -> Vec<(Vector3<f64>, usize)> {
    junctions.sort_by(|(a, votes_a), (b, votes_b)| {
        let by_place = a
            .iter()
            .partial_cmp(b.iter())
            .unwrap_or(std::cmp::Ordering::Equal);
        by_place.then(votes_b.cmp(votes_a))
    });
    junctions.dedup_by(|(a, _), (b, _)| a == b);
    junctions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::observation;
    use neat_core::LineSegment3;

    /// The plane z = 2, seen from below.
    struct Plane;

    impl SignedDistance for Plane {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            points.iter().map(|p| 2.0 - p.z).collect()
        }

        fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            points.iter().map(|p| (2.0 - p.z, -Vector3::z())).collect()
        }
    }

    /// Two segments that share the corner at pixel (20, 20) of a plane at z = 2,
    /// seen by the same camera in six views, with three rays each.
    fn corner() -> (
        Vec<Vector3<f64>>,
        Vec<ViewObservation>,
        Vec<Vec<SupportedSegment>>,
    ) {
        let ends = [[80.0, 20.0], [20.0, 20.0], [20.0, 80.0]];
        let lift = |p: [f64; 2]| Vector3::new((p[0] - 50.0) / 50.0, (p[1] - 50.0) / 50.0, 2.0);
        let view = observation(&[(ends[0], ends[1], 0.9), (ends[1], ends[2], 0.9)]);
        let rays = [[0, 1], [2, 1]]
            .iter()
            .flat_map(|[a, b]| {
                let segment = LineSegment3::new(lift(ends[*a]), lift(ends[*b]));
                [0.2, 0.5, 0.7].map(|t| SupportedSegment {
                    segment,
                    support_point: segment.point_at(t),
                })
            })
            .collect();
        let off_surface = Vector3::new(0.0, 0.0, 0.1);
        let mut junctions: Vec<_> = ends.iter().map(|p| lift(*p) + off_surface).collect();
        junctions.push(Vector3::new(5.0, 5.0, 2.0));
        (junctions, vec![view; 6], vec![rays; 6])
    }

    #[test]
    fn a_corner_becomes_two_edges() {
        let (junctions, views, rays) = corner();
        let result = PaperBackEndConfig::default()
            .run(&junctions, &views, &rays, &Plane)
            .unwrap();
        let expected = [[-0.6, -0.6], [-0.6, 0.6], [0.6, -0.6]];
        assert_eq!(result.wireframe.junctions.len(), 3);
        for (junction, [x, y]) in result.wireframe.junctions.iter().zip(expected) {
            assert!((junction - Vector3::new(x, y, 2.0)).norm() < 1e-12);
        }
        assert_eq!(result.wireframe.edges, [[0, 1], [0, 2]]);
        assert_eq!(result.junction_votes, [6, 6, 6]);
        assert_eq!(result.visible_views, [6, 6]);
        assert_eq!(
            result.counts,
            PaperBackEndCounts {
                rays: 36,
                non_finite_rays: 0,
                lines: 12,
                supported_lines: 12,
                junctions: 4,
                refined_junctions: 4,
                voted_junctions: 3,
                kept_junctions: 3,
                attracted_edges: 2,
                visible_edges: 2,
            }
        );
    }

    #[test]
    fn order_of_input_does_not_change_the_result() {
        let (mut junctions, views, mut rays) = corner();
        let config = PaperBackEndConfig::default();
        let result = config.run(&junctions, &views, &rays, &Plane).unwrap();
        junctions.reverse();
        rays.iter_mut().for_each(|rays| rays.rotate_left(2));
        let other = config.run(&junctions, &views, &rays, &Plane).unwrap();
        assert_eq!(other, result);
    }

    #[test]
    fn isolated_junctions_go_when_asked_to() {
        let (junctions, mut views, rays) = corner();
        // The second segment is seen in four views only: enough for votes.
        views[..2]
            .iter_mut()
            .for_each(|view| view.segments.truncate(1));
        let mut config = PaperBackEndConfig::default();
        let all = config.run(&junctions, &views, &rays, &Plane).unwrap();
        assert_eq!(
            (all.wireframe.junctions.len(), all.wireframe.edges.len()),
            (3, 1)
        );
        config.keep_isolated_junctions = false;
        let used = config.run(&junctions, &views, &rays, &Plane).unwrap();
        assert_eq!(used.wireframe.edges, [[0, 1]]);
        assert_eq!(used.wireframe.segments(), all.wireframe.segments());
        assert_eq!(used.junction_votes.len(), 2);
    }

    #[test]
    fn nothing_in_nothing_out() {
        let (junctions, views, rays) = corner();
        let config = PaperBackEndConfig::default();
        let no_rays = vec![Vec::new(); views.len()];
        for result in [
            config.run(&[], &views, &rays, &Plane),
            config.run(&junctions, &views, &no_rays, &Plane),
            config.run(&junctions, &[], &[], &Plane),
        ] {
            assert_eq!(result.unwrap().wireframe, Wireframe3d::default());
        }
        let one = config.run(&junctions[1..2], &views, &rays, &Plane).unwrap();
        assert_eq!(
            (one.wireframe.junctions.len(), one.wireframe.edges.len()),
            (1, 0)
        );
    }

    #[test]
    fn bad_input_is_refused_or_counted() {
        let (mut junctions, views, mut rays) = corner();
        let config = PaperBackEndConfig::default();
        assert_eq!(
            config.run(&junctions, &views, &rays[1..], &Plane),
            Err(PaperBackEndError::ViewCount { views: 6, rays: 5 })
        );
        rays[3][1].support_point.x = f64::NAN;
        let result = config.run(&junctions, &views, &rays, &Plane).unwrap();
        assert_eq!(result.counts.non_finite_rays, 1);
        assert_eq!(result.counts.supported_lines, 12);
        junctions[0].x = f64::NAN;
        assert_eq!(
            config.run(&junctions, &views, &rays, &Plane),
            Err(RefinementError::NonFiniteJunction { junction: 0 }.into())
        );
    }

    #[test]
    fn junctions_at_one_place_become_one() {
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        let junctions = vec![(at(1.0), 2), (at(-0.0), 3), (at(0.0), 5), (at(-1.0), 4)];
        assert_eq!(
            distinct_and_sorted(junctions),
            [(at(-1.0), 4), (at(0.0), 5), (at(1.0), 2)]
        );
    }

    #[test]
    fn configuration_reads_back_and_knows_its_keys() {
        let published = PaperBackEndConfig::published();
        let text = serde_json::to_string(&published).unwrap();
        assert_eq!(
            serde_json::from_str::<PaperBackEndConfig>(&text).unwrap(),
            published
        );
        assert_eq!(
            serde_json::from_str::<PaperBackEndConfig>("{}").unwrap(),
            PaperBackEndConfig::default()
        );
        let typo = r#"{"visibility": {"min_view": 3}}"#;
        assert!(serde_json::from_str::<PaperBackEndConfig>(typo).is_err());
    }
}
