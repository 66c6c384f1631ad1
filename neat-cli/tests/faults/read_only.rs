//! Disks that may be read only.

use crate::disk::Disk;
use crate::support::{TestScene, assert_same_results, checkpoints, contents, copy_folder, stderr};
use std::fs;

#[test]
fn a_run_on_a_read_only_disk_is_refused_and_goes_on_later() {
    let scene = TestScene::new();
    let Some(disk) = Disk::mount(scene.file("disk")) else {
        return;
    };
    scene.resume("reference").assert().success();
    scene.kill_when("disk/run", |run| checkpoints(run).len() >= 2);
    disk.set_read_only(true);
    let before = contents(disk.path());

    for run in ["disk/new", "disk/run"] {
        let assert = scene.resume(run).arg("--quiet").assert().code(2);
        let message = stderr(&assert);
        let folder = scene.path(run);
        let expected = format!("error: no run can be written to {folder}: check the permissions");
        assert!(message.contains(&expected), "{message}");
        assert!(message.contains("Read-only file system"), "{message}");
    }
    assert!(contents(disk.path()) == before);

    disk.set_read_only(false);
    scene.resume("disk/run").assert().success();
    assert_same_results(&scene.file("disk/run"), &scene.file("reference"));
}

#[test]
fn scenes_may_be_read_only() {
    let scene = TestScene::new();
    let Some(disk) = Disk::mount(scene.file("disk")) else {
        return;
    };
    scene.resume("reference").assert().success();
    copy_folder(&scene.file("scene"), &disk.path().join("scene"));
    disk.set_read_only(true);
    fs::remove_dir_all(scene.file("scene")).unwrap();
    std::os::unix::fs::symlink(disk.path().join("scene"), scene.file("scene")).unwrap();
    scene.resume("run").assert().success();
    assert_same_results(&scene.file("run"), &scene.file("reference"));
}

/// The same by the modes of folders, which bind everybody but root.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn a_folder_without_permission_to_write_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let scene = TestScene::new();
    let folder = scene.file("folder");
    fs::create_dir(&folder).unwrap();
    fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(folder.join("probe"), "").is_ok() {
        eprintln!("skipped: this user may write anywhere");
        return;
    }
    let assert = scene.resume("folder/run").assert().code(2);
    assert!(stderr(&assert).contains("no run can be written to"));
}
