//! What the user sees: results, errors, progress; and what an interrupt leaves behind.

#![expect(clippy::print_stderr, reason = "errors go to standard error")]

use std::{
    borrow::Cow,
    fmt,
    io::{self, IsTerminal, Write},
    path::Path,
    time::Duration,
};

use dioptric_files::unfinished;
use dioptric_pipeline::{PipelineError, SceneLack, has_kept_bands};
use dioptric_report::{DRAWS_PNG, PNG_REMEDY};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// The status of a program that an interrupt ended.
const INTERRUPTED: i32 = 130;

/// The status of a command line that cannot be read.
pub(crate) const WRONG_LINE: i32 = 2;

/// Whoever read standard output is gone.
#[derive(Debug)]
pub(crate) struct ClosedPipe;

impl fmt::Display for ClosedPipe {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("the output is closed")
    }
}

impl std::error::Error for ClosedPipe {}

/// Writes text to standard output.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(output_error)
}

/// Writes a value to standard output as JSON.
pub(crate) fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Returns a number to so many decimals, and 0 without a sign.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').bytes().all(|b| matches!(b, b'0' | b'.')) { text.replace('-', "") } else { text }
}

/// Returns the error of a failed write to standard output; a closed pipe is told apart.
pub(crate) fn output_error(error: io::Error) -> anyhow::Error {
    if error.kind() == io::ErrorKind::BrokenPipe { ClosedPipe.into() } else { error.into() }
}

/// Prints an error and its causes as one sentence on one line.
pub(crate) fn print_error(error: &anyhow::Error) {
    // After an interrupt this waits for the end: what then cannot be written was just removed.
    let _held = unfinished();
    let remedy = error.chain().filter_map(|cause| cause.downcast_ref()).find_map(remedy).unwrap_or_default();
    let sentence = format!("{error:#}{remedy}");
    let words: Vec<&str> = sentence.split_whitespace().collect();
    // Standard error may be closed too; then there is nobody to tell.
    let _ = writeln!(io::stderr(), "error: {}", words.join(" "));
}

/// Returns the words of the command line that mend an error, where it has any.
fn remedy(error: &PipelineError) -> Option<&'static str> {
    if error.is_without_image() {
        return Some("; place the film with --film-mm, its distance behind the last vertex");
    }
    Some(match error.scene_lack()? {
        SceneLack::Depth => " (--depth-m, or depth_m of the camera file)",
        SceneLack::View => " (--fov-deg, or field_of_view_deg of the camera file)",
        SceneLack::DepthAndView => " (--depth-m and --fov-deg, or depth_m and field_of_view_deg of the camera file)",
    })
}

/// Prints a remark, unless the user wants none.
pub(crate) fn remark(quiet: bool, text: &str) {
    if !quiet {
        eprintln!("{text}");
    }
}

/// Tells how to get PNG beside SVG drawings, where this build does not write it.
pub(crate) fn remark_on_png(quiet: bool) {
    if !DRAWS_PNG {
        remark(quiet, &format!("note: {PNG_REMEDY}"));
    }
}

/// Removes half-written results when the user interrupts the program, but for bands from which the same run can go on.
pub(crate) fn remove_partial_files_on_interrupt() {
    let removed = ctrlc::set_handler(|| {
        let held = unfinished();
        let (kept, partial): (Vec<_>, Vec<_>) = held.iter().partition(|path| has_kept_bands(path));
        partial.into_iter().for_each(|path| remove(path));
        for folder in kept {
            // Standard error may be closed too; then there is nobody to tell.
            let words = "with --resume the same command goes on from its bands, and without removes them";
            let _ = writeln!(io::stderr(), "\ninterrupted; {} is kept: {words}", folder.display());
        }
        std::process::exit(INTERRUPTED);
    });
    // Without a handler an interrupt still ends the program; only hidden partial files may stay.
    drop(removed);
}

/// Removes what is half-written, under another name first: a thread that is about to move it to its place finds nothing
/// then, rather than what is left of it.
fn remove(path: &Path) {
    let mut gone = path.as_os_str().to_owned();
    gone.push("-interrupted");
    if std::fs::rename(path, &gone).is_ok() {
        let gone = Path::new(&gone);
        let _ = if gone.is_dir() { std::fs::remove_dir_all(gone) } else { std::fs::remove_file(gone) };
    }
}

/// A progress bar, shown on a terminal only.
pub(crate) struct Bar(Option<ProgressBar>);

impl Bar {
    pub(crate) fn new(quiet: bool) -> Self {
        if quiet || !io::stderr().is_terminal() {
            return Self(None);
        }
        let bar = ProgressBar::new(1000);
        let style = ProgressStyle::with_template("{msg:<28} {bar:40.cyan/dim} {percent:>3}% {elapsed}")
            .expect("the template is well-formed");
        bar.set_style(style.progress_chars("━╸─"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(Some(bar))
    }

    /// Shows what is done and how far it is, 0–1.
    pub(crate) fn show(&self, what: impl Into<Cow<'static, str>>, fraction: f64) {
        if let Some(bar) = &self.0 {
            bar.set_message(what);
            bar.set_position((1000.0 * fraction) as u64);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn nothing_has_no_sign() {
        assert_eq!(
            [-1e-9, 0.0, -0.0, -0.00001, 2.5].map(|value| super::fixed(value, 5)),
            ["0.00000", "0.00000", "0.00000", "-0.00001", "2.50000"]
        );
    }
}
