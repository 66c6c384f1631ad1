//! What installs with the program: its version, completions of shells, manual pages.

mod support;

use std::env;
use std::fs;
use std::process::{Command, Output};
use support::{neat, stdout};

/// Whether a tool is here; says so where it is not.
#[expect(clippy::print_stderr, reason = "a skipped test must say so")]
fn has(tool: &str) -> bool {
    let found = Command::new(tool).arg("--version").output().is_ok();
    if !found {
        eprintln!("skipped: there is no {tool}");
    }
    found
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn the_version_says_what_was_built() {
    let version = env!("CARGO_PKG_VERSION");
    let short = stdout(&neat(&["-V"]).assert().success());
    assert_eq!(short, format!("neat {version}\n"));

    let long = stdout(&neat(&["--version"]).assert().success());
    let lines: Vec<&str> = long.lines().collect();
    assert_eq!(lines[0], format!("neat {version}"));
    let commit = lines[1].strip_prefix("commit: ").unwrap();
    let head = Command::new("git").args(["rev-parse", "HEAD"]).output();
    match head {
        Ok(head) if head.status.success() && env::var_os("NEAT_COMMIT").is_none() => {
            assert_eq!(
                commit,
                &text(&head)[..12],
                "cargo builds anew after a commit"
            );
        }
        _ => assert!(!commit.is_empty()),
    }
    let features = lines[2].strip_prefix("features: ").unwrap();
    assert!(features.contains("flex"), "{features}");
    assert!(lines[3].starts_with("target: "), "{}", lines[3]);
}

#[test]
fn every_shell_gets_its_completions() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = stdout(&neat(&["completions", shell]).assert().success());
        for word in ["reconstruct", "memory-limit", "compare-backends"] {
            assert!(script.contains(word), "{shell} lacks {word}");
        }
    }
    neat(&["completions", "abacus"]).assert().code(2);
}

#[test]
fn bash_completes() {
    if !has("bash") {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let script = dir.path().join("neat.bash");
    fs::write(&script, stdout(&neat(&["completions", "bash"]).assert())).unwrap();
    // As bash does after a tab: words, the one that is completed, and the one before it.
    let complete = |words: &str, count: &str| {
        let ask = r#"
            set -u
            source "$1"
            COMP_WORDS=($2)
            COMP_CWORD=$3
            complete -p neat >/dev/null
            _neat neat "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
            printf '%s\n' "${COMPREPLY[@]}"
        "#;
        let output = Command::new("bash")
            .args(["--norc", "-c", ask, "bash"])
            .arg(&script)
            .args([words, count])
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        text(&output)
    };
    assert_eq!(complete("neat recon", "1"), "reconstruct\n");
    assert_eq!(complete("neat reconstruct --mem", "2"), "--memory-limit\n");
    let presets = complete("neat reconstruct --preset paper-", "3");
    assert_eq!(presets, "paper-abc\npaper-dtu\npaper-blendedmvs\n");
}

#[test]
fn every_command_has_a_manual_page_that_renders() {
    let dir = tempfile::tempdir().unwrap();
    let pages = dir.path().join("share/man1");
    neat(&["man", pages.to_str().unwrap()]).assert().success();
    let help = stdout(&neat(&["help"]).assert().success());
    let commands = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        // What does not fit goes on in the next line, farther in.
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help");
    let names: Vec<String> = commands.map(|name| format!("neat-{name}")).collect();
    assert!(names.len() > 15, "{names:?}");
    // Of commands within commands, too.
    let others = ["neat", "neat-baseline-line3d"];
    for name in names.iter().map(String::as_str).chain(others) {
        let page = fs::read_to_string(pages.join(format!("{name}.1"))).unwrap();
        assert!(
            page.contains(".SH NAME") && page.contains(".SH OPTIONS"),
            "{name}"
        );
    }
    let count = fs::read_dir(&pages).unwrap().count();
    assert_eq!(count, names.len() + others.len());

    if has("man") {
        let page = pages.join("neat-reconstruct.1");
        let output = Command::new("man")
            .env("MANWIDTH", "100")
            .args(["--warnings", "-l"])
            .arg(&page)
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        assert!(output.stderr.is_empty(), "{output:?}");
        let page = text(&output);
        for words in ["SYNOPSIS", "--time-budget", "Examples", "neat-reconstruct"] {
            assert!(page.contains(words), "{words} is missing in:\n{page}");
        }
    }
}

#[test]
fn pages_that_cannot_be_written_are_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "").unwrap();
    let assert = neat(&["man", file.to_str().unwrap()]).assert().failure();
    assert!(support::stderr(&assert).contains("file"));
}
