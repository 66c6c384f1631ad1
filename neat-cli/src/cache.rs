//! Where results are kept between runs.

use clap::Args;
use neat_core::file_cache::FileCache;
use std::env;
use std::path::PathBuf;

/// Whether results are kept between runs.
#[derive(Clone, Copy, Debug, Args)]
pub struct CacheArgs {
    /// Neither use nor keep undistorted images and detected 2D wireframes of earlier runs (in
    /// $NEAT_CACHE, else the user's folder for caches)
    #[arg(long)]
    no_cache: bool,
}

impl CacheArgs {
    /// The cache: in `$NEAT_CACHE`, else below the user's folder for caches; none
    /// if it is not wanted or the system has no such folder.
    pub fn open(self) -> Option<FileCache> {
        let dir = if self.no_cache { None } else { dir() };
        let cache = dir.map(FileCache::new);
        if let Some(cache) = &cache {
            cache.remove_abandoned();
        }
        cache
    }
}

fn dir() -> Option<PathBuf> {
    let path = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    if let Some(dir) = path("NEAT_CACHE") {
        return Some(dir.into());
    }
    let caches = if cfg!(windows) {
        path("LOCALAPPDATA").map(PathBuf::from)
    } else if cfg!(target_os = "macos") {
        path("HOME").map(|home| PathBuf::from(home).join("Library/Caches"))
    } else {
        // By the XDG specification a relative path does not count.
        let configured = path("XDG_CACHE_HOME").map(PathBuf::from);
        let of_home = path("HOME").map(|home| PathBuf::from(home).join(".cache"));
        configured.filter(|dir| dir.is_absolute()).or(of_home)
    };
    Some(caches?.join("neat"))
}
