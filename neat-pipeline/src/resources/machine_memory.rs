//! How much memory may be used where nobody says so.

use neat_core::MemoryLimit;
use sysinfo::{MemoryRefreshKind, ProcessRefreshKind, ProcessesToUpdate, System};

/// Share of the memory that is there: the system and other programs need some.
const SHARE: f64 = 0.75;

/// Three quarters of the machine's memory, or of what a control group leaves to this
/// process, as in a container or in a job of Slurm. No limit where the system does not
/// say.
pub fn default_limit() -> MemoryLimit {
    let mut system = System::new();
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let of_group = sysinfo::get_current_pid().ok().and_then(|pid| {
        let this = ProcessesToUpdate::Some(&[pid]);
        system.refresh_processes_specifics(this, false, ProcessRefreshKind::nothing());
        system.process(pid)?.cgroup_limits()
    });
    limit_of(
        system.total_memory(),
        of_group.map(|group| group.total_memory),
    )
}

/// 0 bytes are the library's word for "not known".
fn limit_of(machine: u64, group: Option<u64>) -> MemoryLimit {
    let least = [Some(machine), group].into_iter().flatten();
    match least.filter(|bytes| *bytes > 0).min() {
        Some(bytes) => MemoryLimit::of_bytes((bytes as f64 * SHARE) as u64),
        None => MemoryLimit::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lesser_of_machine_and_group_counts() {
        assert_eq!(limit_of(4000, Some(1000)), MemoryLimit::of_bytes(750));
        assert_eq!(limit_of(1000, Some(u64::MAX)), MemoryLimit::of_bytes(750));
        assert_eq!(limit_of(1000, None), MemoryLimit::of_bytes(750));
        assert_eq!(limit_of(0, None), MemoryLimit::NONE);
    }

    #[cfg(any(target_os = "linux", target_os = "macos", windows))]
    #[test]
    fn this_machine_has_some_memory() {
        let bytes = default_limit().bytes().unwrap();
        assert!(bytes > 64 << 20, "{bytes}");
    }
}
