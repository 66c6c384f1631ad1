//! A folder of results that take long to compute and can be computed again.
//!
//! One file per result, named by a digest of all that it depends on: nothing is
//! ever out of date, only no longer asked for. The folder is not bounded in size;
//! it can be deleted, whole or in part, at any time.

use crate::{SceneError, file};
use sha2::{Digest, Sha256};
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A folder of results; it is created when the first one is stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileCache {
    dir: PathBuf,
}

/// What a result is and what it depends on: the name of its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CacheKey {
    file_name: String,
}

impl CacheKey {
    /// The key of a result of the kind `kind` (a plain file name, such as
    /// "undistorted") made by `version` of its algorithm from `inputs`.
    pub fn new(kind: &str, version: u32, inputs: &[&[u8]]) -> Self {
        let mut digest = Sha256::new();
        digest.update(version.to_le_bytes());
        for input in inputs {
            // The length first: ("ab", "c") is not ("a", "bc").
            digest.update((input.len() as u64).to_le_bytes());
            digest.update(input);
        }
        let hex: String = digest
            .finalize()
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        Self {
            file_name: format!("{kind}-{hex}"),
        }
    }

    /// What stands before a result: it tells damage, and files that changed their names.
    fn digest_with(&self, result: &[u8]) -> [u8; DIGEST_BYTES] {
        let digest = Sha256::new_with_prefix(&self.file_name);
        digest.chain_update(result).finalize().into()
    }
}

/// Bytes of the digest at the head of every file.
const DIGEST_BYTES: usize = 32;
/// No result takes so long to write.
const ABANDONED: Duration = Duration::from_secs(3600);

impl FileCache {
    /// The cache in the folder `dir`, which need not exist.
    pub fn new(dir: impl Into<PathBuf>) -> Self {
        Self { dir: dir.into() }
    }

    /// The cache that all programs of neat share, in [`dir_of_user`], without what killed
    /// writers left there; `None` if the system has no such folder.
    pub fn of_user() -> Option<Self> {
        let cache = Self::new(dir_of_user()?);
        cache.remove_abandoned();
        Some(cache)
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Removes what writers left that were killed. Those that may still write are spared.
    pub fn remove_abandoned(&self) {
        let entries = fs::read_dir(&self.dir).into_iter().flatten().flatten();
        for path in entries
            .map(|entry| entry.path())
            .filter(|path| file::is_temporary(path))
        {
            let age = fs::metadata(&path).and_then(|about| about.modified()).ok();
            if age.and_then(|age| age.elapsed().ok()) > Some(ABANDONED) {
                // Someone else was faster, or the folder is not ours to tidy.
                let _ = fs::remove_file(&path);
            }
        }
    }

    /// The result stored under `key`, if it is there and undamaged.
    pub fn get(&self, key: &CacheKey) -> Option<Vec<u8>> {
        let mut stored = file::read(&self.path(key), "").ok()?;
        let digest = stored.get(..DIGEST_BYTES)?;
        if digest != key.digest_with(&stored[DIGEST_BYTES..]) {
            return None;
        }
        stored.drain(..DIGEST_BYTES);
        Some(stored)
    }

    /// Stores a result in place of one that may be there.
    ///
    /// # Errors
    /// If the folder cannot be created or written, or the disk is full. The
    /// result need not be stored, so that this is a warning to the user.
    pub fn put(&self, key: &CacheKey, result: &[u8]) -> Result<(), SceneError> {
        file::create_dir(&self.dir)?;
        let stored = [&key.digest_with(result), result].concat();
        file::write_atomically(&self.path(key), &stored)
    }

    fn path(&self, key: &CacheKey) -> PathBuf {
        self.dir.join(&key.file_name)
    }
}

/// The folder for what neat keeps for a user: `$NEAT_CACHE`, else `neat` in the user's folder
/// for caches; `None` if the system has no such folder.
pub fn dir_of_user() -> Option<PathBuf> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;

    #[test]
    fn a_result_under_the_name_of_another_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let cache = FileCache::new(dir.path());
        let [one, other] = [b"1", b"2"].map(|input| CacheKey::new("test", 1, &[input]));
        cache.put(&one, b"result").unwrap();
        fs::copy(cache.path(&one), cache.path(&other)).unwrap();
        assert_eq!(cache.get(&other), None);
        assert!(cache.get(&one).is_some());
    }

    #[test]
    fn what_killed_writers_left_goes_and_what_is_being_written_stays() {
        let dir = tempfile::tempdir().unwrap();
        let cache = FileCache::new(dir.path());
        cache
            .put(&CacheKey::new("test", 1, &[]), b"result")
            .unwrap();
        let [old, new] = [".test-1.77.0.tmp", ".test-2.78.0.tmp"].map(|name| dir.path().join(name));
        for path in [&old, &new] {
            fs::write(path, b"a part").unwrap();
        }
        let file = fs::File::options().write(true).open(&old).unwrap();
        file.set_modified(SystemTime::now() - 2 * ABANDONED)
            .unwrap();
        cache.remove_abandoned();
        assert!(!old.exists() && new.exists());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn results_come_back_until_they_are_damaged() {
        let dir = tempfile::tempdir().unwrap();
        let cache = FileCache::new(dir.path().join("neat/cache"));
        let key = CacheKey::new("test", 1, &[b"input"]);
        assert_eq!(cache.get(&key), None);
        cache.put(&key, b"result").unwrap();
        assert_eq!(cache.get(&key).unwrap(), b"result");
        cache.put(&key, b"").unwrap();
        assert_eq!(cache.get(&key).unwrap(), b"");
        cache.put(&key, b"result").unwrap();

        let file = cache.path(&key);
        let good = fs::read(&file).unwrap();
        for damage in [&good[..good.len() - 1], &good[..20], &[], &good[1..]] {
            fs::write(&file, damage).unwrap();
            assert_eq!(cache.get(&key), None);
        }
        for at in 0..good.len() {
            let mut damaged = good.clone();
            damaged[at] ^= 4;
            fs::write(&file, damaged).unwrap();
            assert_eq!(cache.get(&key), None);
        }
        cache.put(&key, b"again").unwrap();
        assert_eq!(cache.get(&key).unwrap(), b"again");
    }

    #[test]
    fn keys_tell_kind_version_and_inputs_apart() {
        let keys = [
            CacheKey::new("a", 1, &[b"ab", b"c"]),
            CacheKey::new("a", 1, &[b"a", b"bc"]),
            CacheKey::new("a", 1, &[b"abc"]),
            CacheKey::new("a", 1, &[b"ab", b"c", b""]),
            CacheKey::new("a", 2, &[b"ab", b"c"]),
            CacheKey::new("b", 1, &[b"ab", b"c"]),
        ];
        for (index, key) in keys.iter().enumerate() {
            assert!(!keys[..index].contains(key));
        }
        assert_eq!(keys[0], CacheKey::new("a", 1, &[b"ab", b"c"]));
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_an_error_that_names_it() {
        let dir = tempfile::tempdir().unwrap();
        let occupied = dir.path().join("cache");
        fs::write(&occupied, "a file").unwrap();
        let cache = FileCache::new(&occupied);
        let key = CacheKey::new("test", 1, &[]);
        assert_eq!(cache.get(&key), None);
        let error = cache.put(&key, b"result").unwrap_err();
        assert!(error.to_string().contains("cache"), "{error}");
    }
}
