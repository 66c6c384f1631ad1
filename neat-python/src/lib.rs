//! The module `neat3d._neat3d` of the Python package `neat3d`: a door to this workspace, with
//! nothing of its own behind it.
//!
//! | where | what |
//! | --- | --- |
//! | `scene` | a folder, or arrays that become one |
//! | `wireframe2d` | detection in an image |
//! | `run` | reconstruction, and what it leaves |
//! | `evaluation` | published protocols |
//! | `wireframe`, `field` | the result, and what was learned, as arrays |
//! | `background` | threads, Ctrl-C, the interpreter's lock |
//! | `settings`, `arrays`, `errors` | from Python's words to ours, and back |

#![forbid(unsafe_code)]

mod arrays;
mod background;
mod errors;
mod evaluation;
mod field;
mod run;
mod scene;
mod settings;
mod wireframe;
mod wireframe2d;

use neat_export::Format;
use neat_pipeline::config::Preset;
use pyo3::prelude::*;

#[pymodule]
mod _neat3d {
    #[pymodule_export]
    use super::evaluation::evaluate;
    #[pymodule_export]
    use super::field::Field;
    #[pymodule_export]
    use super::run::{Run, reconstruct};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::wireframe::Wireframe;
    #[pymodule_export]
    use super::wireframe2d::{Segments, detect};
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("FORMATS", Format::ALL.map(Format::name))?;
        module.add("KINDS", ["crease", "boundary", "texture", "shadow"])?;
        module.add("PRESETS", Preset::ALL.map(Preset::name))
    }
}
