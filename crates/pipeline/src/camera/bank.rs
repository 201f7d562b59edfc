//! How finely point-spread functions are sampled, and what that leaves wrong.

use dioptric_optics::Lens;
use dioptric_psf::{AdaptiveSettings, BankSettings, ErrorPlaces, FieldSampling, Interpolation, LensImageModel};
use dioptric_spectrum::Cancel;
use serde::{Deserialize, Serialize};

use crate::{PipelineError, number};

/// Places at which the error of a bank is measured: few, for it is measured in every run.
const N_PLACES: usize = 40;
/// The error that nine tenths of the places may have where nothing else is asked for.
const STANDARD_ERROR: f64 = 0.02;
/// The most samples of a bank that is to be as good as asked for, of fields along a radius and over a grid: some 100 and 300 MB.
const MOST_SAMPLES: (usize, usize) = (4000, 12_000);

/// How the point-spread functions of a lens are sampled over field, depth and wavelength.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum BankSpec {
    /// Rays of 9 fields (11 × 11 of a lens without an axis of symmetry), 9 depths and 4 wavelengths, interpolated, and of more where
    /// the error at nine tenths of the places between them is above 2 %; and of more fields where rims begin to cut the pupil, until its areas
    /// between fields are within .1 % where blurs show it.
    #[default]
    Standard,
    /// Rays of as few samples as an error needs.
    Within {
        /// What nine tenths of the places between samples may have: the sum of the differences' magnitudes over the energy.
        error: f64,
    },
    /// The paper's: pictures of 9 fields, 9 depths and 4 wavelengths, blended. For comparison only.
    Paper,
}

impl BankSpec {
    /// Traces a model of a lens's image, and measures the error of its interpolation on pixels of this size.
    ///
    /// `standard` has the standard numbers of samples.
    pub fn build(
        self,
        lens: &Lens,
        standard: BankSettings,
        pitch_um: f64,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<LensImageModel, PipelineError> {
        let places = ErrorPlaces { pitch_um, n_places: N_PLACES, ..ErrorPlaces::STANDARD };
        let is_radial = matches!(standard.fields, FieldSampling::Radial(_));
        let (start, target) = match self {
            Self::Standard => (standard, STANDARD_ERROR),
            Self::Within { error } => (standard.coarse(), error),
            Self::Paper if is_radial => {
                let settings = BankSettings { interpolation: Interpolation::Images, ..standard };
                let model = LensImageModel::build_with(lens, &settings, progress, cancel)?;
                let error = model.measured_error(&places, cancel)?;
                return Ok(model.with_error(error));
            }
            Self::Paper => {
                let reason = format!("the paper's is for a lens with an axis of symmetry, unlike {}", lens.name());
                return Err(PipelineError::Unsuitable { what: "bank", reason });
            }
        };
        let most_samples = if is_radial { MOST_SAMPLES.0 } else { MOST_SAMPLES.1 };
        let wanted = AdaptiveSettings { target, most_samples, places };
        Ok(LensImageModel::build_adaptive(lens, &start, &wanted, progress, cancel)?)
    }
}

/// How a bank was sampled, and the error of what lies between its samples.
///
/// Errors are those of pictures without diffraction at places drawn at random: the sum over pixels of the differences'
/// magnitudes from pictures traced there, over the energy. 0 is perfect, 2 no overlap at all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BankData {
    /// What is interpolated: rays or images.
    pub interpolation: &'static str,
    /// Field angles that see light.
    pub n_fields: usize,
    /// Depths.
    pub n_depths: usize,
    /// Wavelengths.
    pub n_wavelengths: usize,
    /// Half the places have less.
    pub median_error: f64,
    /// Nine tenths of the places have less.
    pub p90_error: f64,
    /// How many places there were.
    pub n_places: usize,
    /// Side of the pixels on which pictures were compared, µm.
    pub pitch_um: f64,
    /// What was asked for of nine tenths of the places: no more than this, unless that takes more samples than there may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_error: Option<f64>,
}

impl BankData {
    /// Returns how a model was sampled, if its error was measured.
    pub fn of(model: &LensImageModel) -> Option<Self> {
        let (settings, error) = (model.settings(), model.error()?);
        Some(Self {
            interpolation: match settings.interpolation {
                Interpolation::Rays => "rays",
                Interpolation::Images => "images",
            },
            n_fields: model.n_fields(),
            n_depths: settings.dioptres.len(),
            n_wavelengths: settings.wavelengths_nm.len(),
            median_error: error.median,
            p90_error: error.p90,
            n_places: error.n_places,
            pitch_um: error.pitch_um,
            wanted_error: error.target,
        })
    }

    /// Returns it in one line.
    pub fn summary(&self) -> String {
        let kind = match self.interpolation {
            "rays" => "rays interpolated between",
            _ => "pictures blended between",
        };
        let Self { n_fields, n_depths, n_wavelengths, n_places, .. } = self;
        let pitch_um = number(self.pitch_um);
        let missed = match self.wanted_error {
            Some(wanted) if self.p90_error > wanted => {
                format!(", above the {} % wanted: more samples do not help, or were too many", number(100.0 * wanted))
            }
            _ => String::new(),
        };
        format!(
            "{kind} {n_fields} fields × {n_depths} depths × {n_wavelengths} wavelengths; error on pixels of {pitch_um} \
             µm at {n_places} places: median {:.2} %, nine tenths below {:.2} %{missed}",
            100.0 * self.median_error,
            100.0 * self.p90_error,
        )
    }
}

#[cfg(test)]
mod tests {
    use dioptric_psf::Diffraction;

    use super::*;

    #[test]
    fn a_bank_has_the_error_asked_for_with_fewer_samples_and_the_papers_has_much_more() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
        let standard = BankSettings::covering(film_distance_mm, 0.2, (0.2, 1.0), (420.0, 680.0), Diffraction::None);
        let build = |choice: BankSpec| choice.build(&lens, standard.clone(), 5.0, &|_| {}, &Cancel::new());
        let data = |choice: BankSpec| BankData::of(&build(choice).unwrap()).unwrap();
        let [rays, within, paper] = [BankSpec::Standard, BankSpec::Within { error: 0.02 }, BankSpec::Paper].map(data);
        for data in [&rays, &within, &paper] {
            println!("{}", data.summary());
        }
        let n = |data: &BankData| data.n_fields * data.n_depths * data.n_wavelengths;
        assert_eq!((n(&rays), n(&paper)), (324, 324));
        assert!(n(&within) < 324 && within.p90_error <= 0.02, "{within:?}");
        assert!(rays.median_error < 0.01 && paper.median_error > 20.0 * rays.median_error, "{rays:?} {paper:?}");
        assert!(paper.summary().starts_with("pictures blended") && !within.summary().contains("wanted"));
        assert!(build(BankSpec::Within { error: -1.0 }).is_err());
    }
}
