//! From an image to its 2D wireframe.
