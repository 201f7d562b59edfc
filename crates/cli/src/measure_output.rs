//! How a picture of a measurement is read, and what becomes of its numbers.

use std::path::Path;

use dioptric_analysis::measure::{CodeCurve, MeasuredPicture, Measurement};
use dioptric_pipeline::{PipelineError, Staged};
use dioptric_report::{MeasurementWords, write_measurement};

use crate::{
    args::Common,
    lens::tell,
    measure_args::{CurveKind, PictureArgs},
    terminal::{print, print_json, remark_on_png},
};

pub(crate) fn curve(kind: CurveKind) -> CodeCurve {
    match kind {
        CurveKind::ByFile => CodeCurve::ByFile,
        CurveKind::Linear => CodeCurve::Linear,
        CurveKind::Srgb => CodeCurve::Srgb,
    }
}

/// Opens a picture to be measured, and tells what of its statements is used.
pub(crate) fn opened(path: &Path, arguments: &PictureArgs, common: &Common) -> Result<MeasuredPicture, PipelineError> {
    let picture = MeasuredPicture::open(path, curve(arguments.curve))?;
    tell(&picture.notes, common);
    Ok(picture)
}

/// What becomes of a measurement: files in a folder, and numbers on standard output.
pub(crate) struct Finish<'a> {
    name: &'static str,
    title: &'static str,
    /// What is measured, as the user named it.
    subject: String,
    common: &'a Common,
    pub(crate) staged: Option<Staged>,
}

impl<'a> Finish<'a> {
    /// Tries the place before the work.
    pub(crate) fn new(
        (name, title): (&'static str, &'static str),
        subject: String,
        folder: Option<&Path>,
        common: &'a Common,
    ) -> anyhow::Result<Self> {
        let staged = folder.map(Staged::folder).transpose()?;
        Ok(Self { name, title, subject, common, staged })
    }

    pub(crate) fn with<M: Measurement>(
        self,
        measured: &M,
        table: impl Fn(&M) -> Result<String, std::fmt::Error>,
    ) -> anyhow::Result<()> {
        let table = table(measured)?;
        if let Some(staged) = self.staged {
            let words = MeasurementWords { name: self.name, title: self.title, subject: &self.subject, table: &table };
            write_measurement(measured, &words, staged.path())?;
            staged.commit()?;
            remark_on_png(self.common.quiet);
        }
        match (self.common.json, self.common.quiet) {
            (true, _) => print_json(measured),
            (false, true) => Ok(()),
            (false, false) => print(&table),
        }
    }
}

pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

pub(crate) fn or_dash(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}"))
}
