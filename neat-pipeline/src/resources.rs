//! What preparing a scene may use, and until when.

mod machine_memory;

pub use machine_memory::default_limit;
pub use neat_images::resources::Resources;
