//! `curitiba man`: manual pages, generated from the declaration of the command line.

use super::{Failure, printed};
use clap::{Args, ValueHint};
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use curitiba::pipeline::files::{check_outputs, create_folder, write_atomically};
use std::io::{self, Write as _};
use std::path::PathBuf;

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Write the pages of all commands there, replacing those of an earlier version; without it the page `curitiba.1` is printed
    #[arg(value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub folder: Option<PathBuf>,
}

/// Prints the page of the program, or writes the pages of all commands.
pub fn run(args: &ManArgs, program: clap::Command) -> Result<(), Failure> {
    let pages = pages(program).map_err(Failure::work)?;
    let Some(folder) = &args.folder else {
        let mut stream = io::stdout().lock();
        return printed(stream.write_all(&pages[0].1).and_then(|()| stream.flush()));
    };
    let wrong = |error: io::Error| Failure::Work(format!("{}: {error}", folder.display()));
    create_folder(folder).map_err(wrong)?;
    let paths: Vec<PathBuf> = pages.iter().map(|(name, _)| folder.join(name)).collect();
    check_outputs(paths.iter().map(|path| (path.as_path(), "manual page")))?;
    for (path, (_, page)) in paths.iter().zip(&pages) {
        write_atomically(path, page).map_err(|error| Failure::Work(format!("{}: {error}", path.display())))?;
    }
    crate::say!("wrote {} pages to {}: man -l {}", pages.len(), folder.display(), paths[0].display());
    Ok(())
}

/// File names and pages: the program's page first, then one for each command.
fn pages(program: clap::Command) -> io::Result<Vec<(String, Vec<u8>)>> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let commands = program.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    std::iter::once(program.clone()).chain(commands).map(page).collect()
}

/// File name and text of a page. Examples keep their lines, which `clap_mangen` would join to paragraphs.
fn page(command: clap::Command) -> io::Result<(String, Vec<u8>)> {
    let more = command.get_after_long_help().or_else(|| command.get_after_help()).map(ToString::to_string);
    let (has_options, has_commands) = (command.get_arguments().next().is_some(), command.has_subcommands());
    let source = concat!("curitiba ", env!("CARGO_PKG_VERSION"));
    let man = Man::new(command).source(source).manual("User Commands");
    let mut text = Vec::new();
    man.render_title(&mut text)?;
    man.render_name_section(&mut text)?;
    man.render_synopsis_section(&mut text)?;
    man.render_description_section(&mut text)?;
    if has_options {
        man.render_options_section(&mut text)?;
    }
    if has_commands {
        man.render_subcommands_section(&mut text)?;
    }
    if let Some(more) = more {
        notes(&more).to_writer(&mut text)?;
    }
    Ok((man.get_filename(), text))
}

/// The text at the end of a help page: indented lines are kept, others are joined to paragraphs.
fn notes(text: &str) -> Roff {
    let mut page = Roff::default();
    let (mut heading, mut fills) = ("", true);
    for line in text.lines() {
        let is_indented = line.starts_with(' ');
        if is_indented == fills && !line.is_empty() {
            fills = !is_indented;
            page.control(if fills { "fi" } else { "nf" }, []);
        }
        let wanted = match line {
            "Example:" | "Examples:" => "EXAMPLES",
            _ if is_indented || line.is_empty() => heading,
            _ => "NOTES",
        };
        if wanted != heading {
            heading = wanted;
            page.control("SH", [heading]);
        } else if line.is_empty() {
            page.control("PP", []);
        }
        if !line.is_empty() && (is_indented || heading != "EXAMPLES") {
            page.text([roman(line)]);
        }
    }
    if !fills {
        page.control("fi", []);
    }
    page
}
