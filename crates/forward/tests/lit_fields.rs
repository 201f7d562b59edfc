//! A film larger than what a lens sees: models end where the light does, however few fields they have.

use dioptric_forward::{Film, PsfDomain};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{Diffraction, FilmMap, GatheredFields, LensImage, LensImageModel, SampleCounts};
use dioptric_spectrum::{Cancel, WavelengthGrid};

#[test]
fn models_of_few_fields_see_as_far_as_those_of_many() {
    let few = SampleCounts { n_radial: 4, n_depths: 2, n_wavelengths: 2, ..SampleCounts::PREVIEW };
    for name in ["dgauss-50mm", "tessar-50mm", "canon-50mm", "cooke-50mm", "dgauss-50mm-schott"] {
        let lens = Lens::built_in(name).unwrap().with_f_number(5.6, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(960.0).unwrap();
        let (film, grid) = (Film::centered(320, 480, 200.0), WavelengthGrid::uniform(426.0, 674.0, 62.0).unwrap());
        let domain = PsfDomain {
            lens: &lens,
            film: &film,
            film_distance_mm,
            depth_range_m: (0.65, 4.0),
            grid: &grid,
            diffraction: Diffraction::None,
        };
        let settings = domain.settings().unwrap();
        // Where a hundredth, a twentieth and a tenth of the light on the axis is left.
        let rims_mm = [few, SampleCounts::PREVIEW, SampleCounts::STANDARD].map(|counts| {
            let model =
                LensImageModel::build_with(&lens, &settings.with_counts(counts), &|_| {}, &Cancel::new()).unwrap();
            assert!(model.is_dark_beyond_extent(), "{name}");
            let FilmMap::Radial(map) = model.film_map(0.7, 550.0, 100.0) else { panic!("{name} has an axis") };
            let step_mm = 1e-3 * map.extent_mm();
            let lights: Vec<f64> =
                (0..=1000).map_while(|i| Some(map.at((step_mm * f64::from(i)).powi(2))?.1)).collect();
            // It ends without a step: a model that ended with its last field would have one of .05 to .12.
            let steepest = lights.windows(2).map(|pair| (pair[1] - pair[0]).abs() / lights[0]).fold(0.0, f64::max);
            assert!(steepest < 0.006 && lights[lights.len() - 1] < 1e-3 * lights[0], "{name}: {steepest}");
            [0.01, 0.05, 0.1]
                .map(|share| step_mm * lights.iter().rposition(|light| *light >= share * lights[0]).unwrap() as f64)
        });
        println!("{name}: {rims_mm:.3?} mm");
        // Narrow pupils change less evenly over two depths and two wavelengths than over many.
        for (few_mm, many_mm) in rims_mm.iter().flat_map(|few_mm| few_mm.iter().zip(&rims_mm[2])) {
            assert!((few_mm / many_mm - 1.0).abs() < 0.01, "{name}: {rims_mm:?}");
        }
        for few_mm in &rims_mm {
            assert!((few_mm[2] / rims_mm[2][2] - 1.0).abs() < 2e-3, "{name}: {rims_mm:?}");
        }
        // Which is 3 % less than the last field that any ray gets through from; here of the bluest band and the farthest depth, others end up to 2 % before it.
        let mono = [426.0, settings.reference_wavelength_nm].map(|nm| lens.at(nm).unwrap());
        let gathered = GatheredFields::about(DVec2::ZERO, (&mono[0], &mono[1]), 1.0 / 4.0, film_distance_mm).unwrap();
        let lit_tan = 0.8 * gathered.largest_lit_share(0.8 * DVec2::X) / 0.97;
        let last_tan = settings.fields.axes().0.last().copied().unwrap();
        assert!((0.95..0.981).contains(&(last_tan / lit_tan)), "{name}: {last_tan} of {lit_tan}");
    }
}
