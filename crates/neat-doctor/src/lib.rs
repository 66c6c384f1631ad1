//! Examines a posed scene: do poses, intrinsics and images agree?
