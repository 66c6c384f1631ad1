//! Faces against the truth: those of a CAD model one by one, those of a rendered scene by area.

mod area_samples;
mod cad_faces;
mod found_face;
mod planar_patches;
mod plane_offsets;
mod scene_faces;
mod true_face;

pub use cad_faces::{CadFaceScores, CadFaces, FaceCounts, FaceShare};
pub use found_face::FoundFace;
pub use plane_offsets::PlaneOffset;
pub use scene_faces::{FaceShares, SceneFaceScores, SceneFaces};
pub use true_face::TrueFace;
