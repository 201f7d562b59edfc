//! How well a model of each lens's image interpolates: `cargo run --release --example bank_errors -p dioptric-pipeline [LENS …]`
//! puts lenses, built-in or of files, in place of the demo's, at f/4 or as wide as they open, and prints the samples and the error.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example shows its numbers, and stops where one is missing"
)]

use std::{path::Path, time::Instant};

use dioptric_optics::Lens;
use dioptric_pipeline::{Camera, KeptCamera, LensSpec, Silent, StopSpec};
use dioptric_spectrum::Cancel;

fn main() {
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    if wanted.is_empty() {
        wanted = Lens::built_in_names().map(str::to_owned).collect();
    }
    let kept = KeptCamera::new(Camera::demo().unwrap());
    println!("lens, fields, depths, wavelengths, median %, nine tenths %, seconds");
    for name in wanted {
        let source = match Path::new(&name).exists() {
            true => LensSpec::File(name.clone().into()),
            false => LensSpec::BuiltIn(name.clone()),
        };
        let built = |stop: StopSpec| {
            let kept = kept.with(|camera| (camera.lens, camera.stop) = (source.clone(), stop));
            let start = Instant::now();
            kept.model(&Silent, &Cancel::new()).map(|model| (model, start.elapsed().as_secs_f64()))
        };
        match built(StopSpec::FNumber(4.0)).or_else(|_| built(StopSpec::default())) {
            Ok((model, seconds)) => {
                let (settings, error) = (model.settings(), model.error().unwrap());
                let (fields, [depths, wavelengths]) =
                    (model.n_fields(), [settings.dioptres.len(), settings.wavelengths_nm.len()]);
                let [median, p90] = [error.median, error.p90].map(|e| 100.0 * e);
                println!("{name}, {fields}, {depths}, {wavelengths}, {median:.2}, {p90:.2}, {seconds:.2}");
            }
            Err(reason) => println!("{name}: {reason}"),
        }
    }
}
