//! The command line.

use clap::{Parser, ValueHint};
use curitiba::args::ProjectArgs;
use std::path::PathBuf;

/// Shows what every pass of a project writes and takes, and what its settings change.
#[derive(Debug, Parser)]
#[command(
    name = "curitiba-view",
    version,
    max_term_width = 110,
    arg_required_else_help = true,
    after_help = "\
Examples:
  curitiba view xml_projects/SceneFinal.xml
  curitiba view model.glb --size 800x600 --effects shadows,ao
  curitiba view xml_projects/SceneSSAO.xml --reference ao.exr

F1 in the window shows its keys; docs/viewer.md has them, too."
)]
pub struct ViewArgs {
    /// What is shown, as `curitiba render` takes it.
    #[command(flatten)]
    pub project: ProjectArgs,
    /// A picture (.png, .exr) to compare with
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub reference: Option<PathBuf>,
    /// Read and write no file outside this folder, wherever symbolic links lead: for projects of strangers
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub confine: Option<PathBuf>,
    /// Close the window after it was drawn so often with a picture in it: for tests
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub quit_after: Option<u32>,
    /// Write the whole window as a picture before it closes
    #[arg(long, value_name = "FILE.png", requires = "quit_after", value_hint = ValueHint::FilePath)]
    pub window_png: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent_and_takes_what_render_takes() {
        ViewArgs::command().debug_assert();
        let words =
            ["curitiba-view", "p.xml", "--size", "64x48", "--set", "a.samples=4", "--off", "b", "--backend", "cpu"];
        let args = ViewArgs::try_parse_from(words).expect("valid");
        let settings = args.project.settings();
        assert_eq!((settings.size, settings.off.as_slice()), (Some([64, 48]), &["b".to_owned()][..]));
        assert!(ViewArgs::try_parse_from(["curitiba-view", "p.xml", "--quit-after", "0"]).is_err());
    }
}
