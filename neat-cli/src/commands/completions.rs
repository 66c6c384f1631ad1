//! `neat completions`.

use super::Cli;
use crate::error::CliError;
use crate::output;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Print what completes neat's commands and options in a shell
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat completions bash > ~/.local/share/bash-completion/completions/neat
  neat completions zsh > ~/.zfunc/_neat                   a folder of $fpath
  neat completions fish > ~/.config/fish/completions/neat.fish
  neat completions powershell >> $PROFILE")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    shell: Shell,
}

impl CompletionsArgs {
    pub fn run(self) -> Result<(), CliError> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "neat", &mut script);
        output::print(String::from_utf8_lossy(&script).trim_end())
    }
}
