//! What the command line of the window asks for, and what it is told where no window can be opened.

use std::{ffi::OsString, path::PathBuf};

/// What is shown for `--help`.
const HELP: &str = "\
The window of dioptric: change anything of a camera and see its picture.

Usage: dioptric-studio [CAMERA.ron]

Without a camera file it goes on with the camera as it was left, at first with the demo.

Options:
  -h, --help     Shows this
  -V, --version  Shows the version";

/// What the command line asks for.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Asked {
    /// The window, of a camera file where one is named.
    Window(Option<PathBuf>),
    /// Words.
    Words(String),
}

impl Asked {
    /// Reads the words behind the name of the program; the error is a sentence.
    pub(crate) fn of(words: impl Iterator<Item = OsString>) -> Result<Self, String> {
        let mut camera = None;
        let mut is_path = false;
        for word in words {
            match word.to_str() {
                Some("--") if !is_path => is_path = true,
                Some("-h" | "--help") if !is_path => return Ok(Self::Words(HELP.to_owned())),
                Some("-V" | "--version") if !is_path => {
                    return Ok(Self::Words(format!("dioptric-studio {}", env!("CARGO_PKG_VERSION"))));
                }
                Some(option) if !is_path && option.starts_with('-') => {
                    return Err(format!("'{option}' is no option, expected --help, --version or a camera file"));
                }
                _ => {
                    if let Some(first) = camera.replace(PathBuf::from(&word)) {
                        let (first, second) = (first.display(), word.display());
                        return Err(format!("'{first}' and '{second}' are two files, expected one camera file"));
                    }
                }
            }
        }
        Ok(Self::Window(camera))
    }
}

/// Returns in one sentence why no window can be opened, without the places of sources that libraries name.
pub(crate) fn why_no_window(error: &str, has_display: bool) -> String {
    if !has_display {
        return "no window can be opened: neither DISPLAY nor WAYLAND_DISPLAY names a screen; `dioptric run` needs none".to_owned();
    }
    // As "os error at /a/path/event_loop.rs:789: reason".
    let mut words = error.lines().collect::<Vec<_>>().join(" ");
    while let Some(start) = words.find("os error at ") {
        let place = &words[start..];
        let end = place.find(".rs:").and_then(|file| place[file + 4..].find(": ").map(|end| file + 4 + end + 2));
        words.replace_range(start..start + end.unwrap_or("os error at ".len()), "");
    }
    format!("no window can be opened: {}", words.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(words: &[&str]) -> Result<Asked, String> {
        Asked::of(words.iter().map(OsString::from))
    }

    #[test]
    fn words_and_files_are_told_apart() {
        assert_eq!(asked(&[]), Ok(Asked::Window(None)));
        assert_eq!(asked(&["a.ron"]), Ok(Asked::Window(Some("a.ron".into()))));
        assert_eq!(asked(&["--", "--help"]), Ok(Asked::Window(Some("--help".into()))));
        assert!(matches!(asked(&["a.ron", "--help"]), Ok(Asked::Words(words)) if words.contains("Usage")));
        assert!(matches!(asked(&["-V"]), Ok(Asked::Words(words)) if words.starts_with("dioptric-studio ")));
        assert!(asked(&["--fullscreen"]).unwrap_err().contains("'--fullscreen' is no option"));
        assert!(asked(&["a.ron", "b.ron"]).unwrap_err().contains("two files"));
    }

    #[test]
    fn why_there_is_no_window_names_no_source() {
        let error = "winit EventLoopError: os error at /src/winit-0.30/src/event_loop.rs:789: no screen";
        assert_eq!(why_no_window(error, true), "no window can be opened: winit EventLoopError: no screen");
        assert!(why_no_window(error, false).contains("neither DISPLAY nor WAYLAND_DISPLAY"));
    }
}
