//! What must hold before a report is rendered.

use crate::{Report, ReportError};
use neat_core::Camera;
use neat_wireframe::validity::check_wireframe;
use std::collections::{BTreeMap, BTreeSet};

/// Checks that all parts of a report fit each other.
pub(crate) fn check(report: &Report) -> Result<(), ReportError> {
    let document = &report.document;
    let (junctions, edges) = (document.junctions.len(), document.edges.len());
    check_wireframe(&document.junctions, &document.edges)?;
    check_fields(&document.junction_fields.named(), junctions, "junction")?;
    check_fields(&document.edge_fields.named(), edges, "edge")?;

    let covariances = &document.junction_covariances;
    let finite = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
    let fits = covariances.is_empty() || covariances.len() == junctions;
    if !fits || !covariances.iter().flatten().all(|c| finite(c)) {
        return Err(field("junction_covariances", junctions, "junction"));
    }

    let support = &document.edge_support;
    let fits = support.is_empty() || support.len() == edges;
    let mut supporting = support.iter().flatten();
    if !fits
        || !supporting.all(|segment| {
            segment.view < document.views.len()
                && segment.residual.is_finite()
                && finite(&segment.segment)
        })
    {
        return Err(field("edge_support", edges, "edge"));
    }
    let known: BTreeSet<&str> = report.views.iter().map(|view| view.name.as_str()).collect();
    let used: BTreeSet<usize> = support.iter().flatten().map(|s| s.view).collect();
    for index in used {
        let name = &document.views[index];
        if !known.contains(name.as_str()) {
            return Err(ReportError::UnknownView(name.clone()));
        }
    }

    for view in &report.views {
        // In a frame that is mirrored the axes of all cameras are left-handed.
        let turn = view.camera.world_from_camera;
        let right_handed = Camera {
            world_from_camera: turn * turn.determinant().signum(),
            ..view.camera
        };
        right_handed
            .validate()
            .map_err(|problem| ReportError::Camera {
                view: view.name.clone(),
                problem,
            })?;
        let not_finite = (view.segments.iter()).position(|segment| {
            let mut numbers = segment.ends().into_iter().flat_map(|end| [end.x, end.y]);
            numbers.any(|x| !x.is_finite())
        });
        if let Some(segment) = not_finite {
            return Err(ReportError::Segment {
                view: view.name.clone(),
                segment,
            });
        }
    }
    Ok(())
}

fn check_fields(
    fields: &BTreeMap<String, Vec<f64>>,
    expected: usize,
    of: &'static str,
) -> Result<(), ReportError> {
    let bad = |values: &Vec<f64>| values.len() != expected || values.iter().any(|x| !x.is_finite());
    match fields.iter().find(|(_, values)| bad(values)) {
        Some((name, _)) => Err(field(name, expected, of)),
        None => Ok(()),
    }
}

fn field(name: &str, expected: usize, of: &'static str) -> ReportError {
    ReportError::Field {
        field: name.to_owned(),
        expected,
        of,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReportView;
    use nalgebra::{Matrix3, Vector2, Vector3};
    use neat_core::{Intrinsics, LineSegment2};
    use neat_wireframe::export::{EdgeFields, SupportingSegment, WireframeDocument};

    fn good() -> Report {
        let support = SupportingSegment {
            view: 0,
            segment: [0.0, 1.0, 2.0, 3.0],
            residual: 0.5,
        };
        Report {
            document: WireframeDocument {
                junctions: vec![Vector3::zeros(), Vector3::x()],
                edges: vec![[0, 1]],
                edge_fields: EdgeFields {
                    probability: Some(vec![0.5]),
                    ..EdgeFields::default()
                },
                junction_covariances: vec![None, Some([1.0; 6])],
                views: vec!["a".into()],
                edge_support: vec![vec![support]],
                ..WireframeDocument::default()
            },
            views: vec![ReportView {
                name: "a".into(),
                camera: Camera {
                    intrinsics: Intrinsics::centered(10.0, (8, 6)),
                    world_from_camera: Matrix3::identity(),
                    center_in_world: -2.0 * Vector3::z(),
                    width: 8,
                    height: 6,
                },
                photograph: None,
                segments: vec![LineSegment2::new(Vector2::zeros(), Vector2::x())],
            }],
            ..Report::default()
        }
    }

    #[test]
    fn cameras_of_a_mirrored_frame_are_right() {
        let mut mirrored = good();
        mirrored.views[0].camera.world_from_camera *= -1.0;
        check(&mirrored).unwrap();
        mirrored.views[0].camera.world_from_camera *= 2.0;
        check(&mirrored).unwrap_err();
    }

    #[test]
    fn parts_that_do_not_fit_are_named() {
        check(&good()).unwrap();
        check(&Report::default()).unwrap();
        type Damage = (&'static str, fn(&mut Report));
        let damages: [Damage; 9] = [
            ("wireframe is not valid", |r| r.document.edges[0] = [0, 2]),
            ("`probability`", |r| {
                r.document.edge_fields.probability = Some(vec![]);
            }),
            ("`probability`", |r| {
                r.document.edge_fields.probability = Some(vec![f64::NAN]);
            }),
            ("`junction_covariances`", |r| {
                r.document.junction_covariances[1] = Some([f64::INFINITY; 6]);
            }),
            ("`edge_support`", |r| r.document.edge_support[0][0].view = 1),
            ("`edge_support`", |r| r.document.edge_support.push(vec![])),
            ("view `b`", |r| r.document.views[0] = "b".into()),
            ("view `a`", |r| r.views[0].camera.intrinsics.fx = 0.0),
            ("segment 0 of view `a`", |r| {
                r.views[0].segments[0].start.x = f64::NAN;
            }),
        ];
        for (expected, damage) in damages {
            let mut report = good();
            damage(&mut report);
            let message = report.render().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
